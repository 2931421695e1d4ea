"""The reference problems: scenes with known answers, one registry for tests, examples and the bench."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.temporaries import temporary_folder
from bellcrank.messages import unknown_name
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.problems import cart_pole, closed_linkages, free_body, open_chains, robots, rolling, upright_falls
from bellcrank_bench.problems.problem import Figure, Problem

_ALL = (
    *open_chains.PROBLEMS,
    *upright_falls.PROBLEMS,
    *cart_pole.PROBLEMS,
    *free_body.PROBLEMS,
    *robots.PROBLEMS,
    *closed_linkages.PROBLEMS,
    *rolling.PROBLEMS,
)
PROBLEMS: Final[dict[str, Problem]] = {problem.name: problem for problem in _ALL}
BASE_LINKS = 20  # the chain that longer ones are timed against
FIRST_RUNS = {"ur5_falling": 1.0, "talos_free_fall": 5.0}  # s, from an empty cache


@dataclass(frozen=True)
class Row:
    """A figure of a problem, and the seconds that the problem took in all."""

    problem: str
    title: str
    figure: Figure
    seconds: float


def problem(name: str) -> Problem:
    """The reference problem of that name. Raises InputError with what there is."""
    if name not in PROBLEMS:
        raise InputError(unknown_name("problem", name, PROBLEMS))
    return PROBLEMS[name]


def hard_cases(progress: Callable[[str], None] = lambda name: None) -> list[Row]:
    """Every problem simulated and judged, then times of chains and of first runs; about a minute.

    `progress` is called with each one's name before it starts. Raises BellcrankError where a first run fails.
    """
    jobs: list[tuple[str, str, Callable[[], list[Figure]]]] = [(p.name, p.title, p.figures) for p in _ALL]
    jobs.append(("chain_speed", f"time a link and evaluation, against {BASE_LINKS} links", _chain_speed))
    loops = closed_linkages.loops_at_speed
    jobs.append(("n_four_bar_speed", "time a loop and evaluation of the N four-bar, against 5 loops", loops))
    jobs.append(("first_runs", "first runs with Radau from an empty cache, in new processes", _first_runs))
    jobs.append(("chain_100_compile", "chain of 100 links compiled from an empty cache, in a new process", _compile))
    rows = []
    for name, title, figures in jobs:
        progress(name)
        begun = time.perf_counter()
        found = figures()
        seconds = time.perf_counter() - begun
        rows += [Row(name, title, figure, seconds) for figure in found]
    return rows


def _chain_speed() -> list[Figure]:
    """Seconds of stepping a link and evaluation, the best of 9 runs taken in turns."""
    scenes = {links: robots.chain_scene(links) for links in robots.LINKS}
    best = dict.fromkeys(scenes, float("inf"))
    for _ in range(9):
        for links, scene in scenes.items():
            cost = simulate(scene, **robots.CHAIN_SETTINGS).statistics
            best[links] = min(best[links], cost.kernel_time / cost.evaluations / links)
    bars = {links: 1.5 if links > BASE_LINKS else float("inf") for links in scenes}
    return [
        Figure(f"{links} links, {best[links] * 1e9:.1f} ns", best[links] / best[BASE_LINKS], bars[links], "times")
        for links in scenes
        if links != BASE_LINKS
    ]


def _first_runs() -> list[Figure]:
    """Seconds from `import bellcrank` to the end of 0.1 s of a fall with Radau."""
    return [
        Figure(f"{name} with Radau", _fresh(f"bellcrank.simulate({name!r}, duration=0.1, solver='Radau')"), bar, "s")
        for name, bar in FIRST_RUNS.items()
    ]


def _compile() -> list[Figure]:
    path = str(robots.chain_scene(100).source)
    return [Figure("100 links", _fresh(f"bellcrank.load_scene({path!r}).system.rhs.address('scalar')"), 5.0, "s")]


def _fresh(statement: str) -> float:
    """Seconds, the better of 2, that `import bellcrank` and a statement take in a new process with an empty cache."""
    return min(_fresh_once(statement) for _ in range(2))


def _fresh_once(statement: str) -> float:
    script = (
        f"import time\nbegun = time.perf_counter()\nimport bellcrank\n{statement}\nprint(time.perf_counter() - begun)\n"
    )
    with temporary_folder("bench") as folder:
        environment = {**os.environ, "BELLCRANK_CACHE": str(folder)}
        command = [sys.executable, "-c", script]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise BellcrankError(f"timing '{statement}' failed: {done.stderr.strip().splitlines()[-1:]}")
    return float(done.stdout)
