"""`bellcrank check`: findings about robot files."""

from __future__ import annotations

import argparse

from bellcrank.commands.options import add_trust
from bellcrank.robot.catalog import find_urdf
from bellcrank.robot.check import check_urdf, format_findings
from bellcrank.robot.xml_tree import parse_xml, read_text


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The files to check."""
    parser.add_argument(
        "files",
        metavar="FILE",
        nargs="+",
        help="robot files (URDF, xacro, MJCF, SDF), or names that `bellcrank robots` lists, such as ur5",
    )
    add_trust(parser)


def run(args: argparse.Namespace) -> int:
    """Print the findings about each file. Exit code 0: no errors; 1: a file has errors. Raises InputError, before
    anything is printed, where a file does not exist or is not XML.
    """
    paths = [find_urdf(name) for name in args.files]
    for path in paths:
        parse_xml(read_text(path), path)
    status = 0
    for path in paths:
        findings = check_urdf(path, trust=args.trust)
        print(f"{path}:\n{format_findings(findings)}", flush=True)
        if any(found.severity == "error" for found in findings):
            status = 1
    return status
