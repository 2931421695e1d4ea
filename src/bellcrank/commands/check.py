"""`bellcrank check`: findings about robot files, and the start and mobility of mechanisms."""

from __future__ import annotations

import argparse
from pathlib import Path

from bellcrank.commands.options import add_page, add_trust, page_of
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess
from bellcrank.files.atomic_write import default_place
from bellcrank.robot.catalog import find_urdf
from bellcrank.robot.checks.check import check_urdf, format_findings
from bellcrank.robot.formats.file_readers import read_robot_file
from bellcrank.robot.formats.xml_tree import parse_xml, read_text

CONFIGURATIONS = (".yaml", ".yml")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The files to check, and the page to write."""
    parser.add_argument(
        "files",
        metavar="FILE",
        nargs="+",
        help="robot files (URDF, xacro, MJCF, SDF), names that `bellcrank robots` lists, such as ur5, or "
        "configurations (YAML) of mechanisms",
    )
    add_page(
        parser,
        "the mechanism at its start, or the gaps of its loops where it has none,",
        "NAME_start.html in the current folder",
    )
    parser.add_argument("--html", dest="page", nargs="?", const="", metavar="FILE", help="the same as --page")
    add_trust(parser)


def run(args: argparse.Namespace) -> int:
    """Print the findings about each file. Exit code 0: no errors; 1: a file has errors, or a mechanism has no start.
    Raises InputError, before anything is printed, where a file does not exist or is not XML.
    """
    if args.page and len(args.files) > 1:
        raise InputError(f"--page {args.page}: expected one file, found {len(args.files)}; write --page without a name")
    paths = [Path(name) if _is_configuration(name) else find_urdf(name) for name in args.files]
    for path in paths:
        if not _is_configuration(path):
            parse_xml(read_text(path), path)
    pages = [page_of(args, default_place(f"{path.stem}_start.html")) for path in paths]
    configured = [_configuration_of(name) for name in args.files]
    return max(
        _check(path, page, args.trust, scene) for path, page, scene in zip(paths, pages, configured, strict=True)
    )


def _is_configuration(name: str | Path) -> bool:
    return Path(name).suffix.lower() in CONFIGURATIONS


def _configuration_of(name: str) -> Path | None:
    """The bundled configuration of this name that adds constraints to the robot file of the same name."""
    from bellcrank.config.yaml_file import read_yaml
    from bellcrank.scene.robot_config import names

    path = None if Path(name).exists() else names().get(name)
    return path if path is not None and "constraints" in read_yaml(path) else None


def _check(path: Path, page: Path | None, trust: list[str], configuration: Path | None) -> int:
    """Print the findings about a file and write its page; 1 where there are errors. The mechanism is that of a
    configuration where there is one.
    """
    if _is_configuration(path):
        print(f"{path}:", flush=True)
        return _check_mechanism(path, page, trust)
    findings = check_urdf(path, trust=trust)
    print(f"{path}:\n{format_findings(findings)}", flush=True)
    if any(found.severity == "error" for found in findings):
        return 1
    if configuration is not None:
        print(f"{configuration}:", flush=True)
        return _check_mechanism(configuration, page, trust)
    if page is None and not read_robot_file(path, FileAccess.of(path.resolve(), trust)).loops:
        return 0
    return _check_mechanism(path, page, trust)


def _check_mechanism(path: Path, page: Path | None, trust: list[str]) -> int:
    """Print what is found about the mechanism of a file and write its page; 1 where it has no start."""
    from bellcrank.reports.mechanism_check import check_mechanism
    from bellcrank.scene.scene import load_scene

    checked = check_mechanism(load_scene(path, trust=trust))
    print(checked)
    if page is not None:
        from bellcrank.replays.page.page import write_page

        written = write_page(checked.film(), page)
        print(f"wrote {written} ({written.stat().st_size / 1e6:.2f} MB)")
    return 0 if checked.has_start else 1
