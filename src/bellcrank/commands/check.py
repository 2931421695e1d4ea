"""`bellcrank check`: findings about robot files, and the start and mobility of mechanisms."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.arrays import Array
from bellcrank.commands.options import add_page, add_trust, page_of
from bellcrank.dynamics.constraints.mobility import mobility
from bellcrank.dynamics.postures.consistent_start import (
    consistent_start,
    given_posture,
    start_failure,
    starts_further_away,
)
from bellcrank.dynamics.postures.start_diagnosis import Gap
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess
from bellcrank.files.atomic_write import default_place
from bellcrank.robot.catalog import find_urdf
from bellcrank.robot.checks.check import check_urdf, format_findings
from bellcrank.robot.formats.file_readers import read_robot_file
from bellcrank.robot.formats.xml_tree import parse_xml, read_text

if TYPE_CHECKING:
    from bellcrank.replays.film.film import Film
    from bellcrank.scene.scene import Scene

CONFIGURATIONS = (".yaml", ".yml")


@dataclass(frozen=True, eq=False, kw_only=True)
class MechanismCheck:
    """Facts about a mechanism, and the posture that shows it.

    Attributes:
        scene: The mechanism.
        posture: Its start (nq,), or the position with the smallest gaps that was found.
        facts: (name, sentence), the result first; an "error" means that there is no start.
        gaps: The constraints that are not satisfied at the posture.
    """

    scene: Scene
    posture: Array
    facts: tuple[tuple[str, str], ...]
    gaps: tuple[Gap, ...] = ()

    @property
    def has_start(self) -> bool:
        """Whether there is a consistent start."""
        return not any(name == "error" for name, _ in self.facts)

    def __str__(self) -> str:
        return "\n".join(f"  {name:<8} {text}" for name, text in self.facts)

    def film(self) -> Film:
        """The robot at the posture, with its gaps."""
        from bellcrank.replays.film.posture_films import film_of_start

        return film_of_start(self.scene, self.posture, self.gaps, self.facts)


def check_mechanism(scene: Scene) -> MechanismCheck:
    """Search the start of a scene and look at its mobility. Raises InputError where constraints are invalid."""
    failure = start_failure(scene)
    if failure is not None:
        facts = [("error", "no start was found that satisfies the constraints")]
        facts += [("gaps", text) for text in failure.sentences()]
        return MechanismCheck(scene=scene, posture=failure.posture, facts=tuple(facts), gaps=failure.gaps)
    try:
        q, _ = consistent_start(scene)
    except InputError as error:  # of velocities, or where rows are undefined
        text = str(error).removeprefix(f"{scene.source}: ")
        return MechanismCheck(scene=scene, posture=given_posture(scene), facts=(("error", text),))
    away = "a consistent start was found"
    if starts_further_away(scene):
        away += ", but not near the given posture: another branch may be meant; write guesses nearer to it ({guess: …})"
    facts = [("start", away), *(("mobility", line) for line in str(mobility(scene)).splitlines())]
    return MechanismCheck(scene=scene, posture=q, facts=tuple(facts))


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
    from bellcrank.scene.scene import load_scene

    checked = check_mechanism(load_scene(path, trust=trust))
    print(checked)
    if page is not None:
        from bellcrank.replays.page.page import write_page

        written = write_page(checked.film(), page)
        print(f"wrote {written} ({written.stat().st_size / 1e6:.2f} MB)")
    return 0 if checked.has_start else 1
