"""How many small faults of the physics code the tests find: draws mutants by seed, and runs the tests on each.

    python docs/tools/mutants.py --list                                     # what is drawn
    python docs/tools/mutants.py --tier 1 --out mutants.jsonl               # runs; a second call goes on
    python docs/tools/mutants.py --tier 2 --out mutants.jsonl --survivors   # those that tier 1 did not find

mutant_places.py says what a mutant is. Each is put into a copy of the installed package, in a temporary folder that
comes first on the import path; a mutant of C++ is compiled into its extension there, which needs g++, cmake and ninja
and, in this environment, nanobind and cmeel-eigen (CONTRIBUTING.md, "Set up"); without them, --cpp 0. The tests are
those of this checkout, stopped at the first that fails. One on which a test never ends is killed by that test.

A mutant that cannot be imported or compiled is not counted, and another is drawn, unless it is a static_assert that
fails. Nor is one that no test can find, because the program does the same: mutants_equivalent.yaml has its file, its
line before and after, and the reason.

First the tests of the tier run once on an unchanged copy, which gives their durations and leaves out those that fail
(not with --durations, a JUnit file of such a run). With --coverage, a file of

    pytest --cov=bellcrank --cov-context=test

the tests that reach the mutated line run first. The file does not name all of them, since what one test compiles the
next finds in the cache, so that the tests of the same room, of the machines and of the command line follow, and then
all others; --reach stops before.
"""

from __future__ import annotations

import argparse
import json
import signal
import threading
import time
import xml.etree.ElementTree as ElementTree
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any

import yaml
from mutant_cpp_places import cpp_places
from mutant_places import KINDS, Mutant, drawn, python_places
from mutant_runs import ROOT, Builds, Record, applied, copied, end_all, installed, lacks_for_cpp, run_tests

TIERS = {1: "not tier2", 2: "tier2"}
CHEAP = 40  # tests of those that reach the line that run before the others
FOR_CPP = ("simulation", "planning", "studies", "dynamics", "codegen", "cpp")  # rooms whose tests run C++
REACHES = ("covering", "near", "all")
NOT_COUNTED = "incompetent"
ASSERTION = "static assertion failed"  # a test that the compiler runs
EQUIVALENT = Path(__file__).with_name("mutants_equivalent.yaml")


@dataclass
class Results:
    """The lines of the file of results: one a mutant and tier, and the durations of the tests of each tier."""

    path: Path | None
    records: list[Record] = field(default_factory=list)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def __post_init__(self) -> None:
        if self.path and self.path.exists():
            self.records = [json.loads(line) for line in self.path.read_text("utf-8").splitlines()]

    def add(self, **record: Any) -> None:
        """Keep a line, in memory and in the file."""
        with self.lock:
            self.records.append(record)
            if self.path:
                with self.path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(record) + "\n")

    def of(self, mutant: Mutant) -> dict[int, Record]:
        """Tier -> what became of a mutant."""
        return {record["tier"]: record for record in self.records if record.get("mutant") == mutant.name}

    def killed(self, mutant: Mutant) -> bool:
        """Whether a tier has found it."""
        return any(record["outcome"] in ("killed", "timed out") for record in self.of(mutant).values())


def equivalent() -> dict[tuple[str, str, str], str]:
    """The reason why the program does the same, of each change (`Mutant.change`) of which that is known."""
    entries = yaml.safe_load(EQUIVALENT.read_text("utf-8"))
    return {(one["file"], one["before"], one["after"]): one["reason"] for one in entries}


def selection(streams: Iterable[tuple[dict[str, list[Mutant]], int]], results: Results) -> list[Mutant]:
    """Of each pair of drawn mutants and a number that many, equally of each kind, less those that do not count."""
    bad = {record["mutant"] for record in results.records if record.get("outcome") == NOT_COUNTED}
    same = equivalent()
    found: list[Mutant] = []
    for stream, count in streams:
        shares = [count // len(KINDS) + (k < count % len(KINDS)) for k in range(len(KINDS))]
        kinds = [
            [m for m in stream[kind] if m.name not in bad and m.change not in same][:share]
            for kind, share in zip(KINDS, shares, strict=True)
        ]
        found += [m for m in chain.from_iterable(zip_longest(*kinds)) if m]
    return found


# ---- tests


def baseline(package: Path, tests: list[str], marker: str) -> dict[str, float]:
    """The tests that pass on an unchanged copy, with their durations, s."""
    with copied(package) as copy:
        run = run_tests(copy, ["-m", marker, *tests], None, {})
    if run.code not in (0, 1):
        raise SystemExit(
            f"the tests do not run on an unchanged copy, pytest ends with {run.code}:\n{run.output[-3000:]}"
        )
    failed = {entry["failed"]: entry["why"] for entry in run.log if "failed" in entry}
    for test, why in failed.items():
        print(f"left out, fails without any mutant: {test}: {why}", flush=True)
    return {e["ended"]: e["seconds"] for e in run.log if "ended" in e and e["ended"] not in failed}


def junit_durations(path: Path) -> dict[str, float]:
    """Durations of the tests that passed, of a JUnit file, by node id."""
    found = {}
    for case in ElementTree.parse(path).iter("testcase"):
        parts = case.get("classname", "").split(".")
        lengths = [
            k
            for k in range(len(parts), 0, -1)
            if parts[k - 1] and (ROOT / Path(*parts[:k]).with_suffix(".py")).exists()
        ]
        if lengths and not any(child.tag in ("failure", "error", "skipped") for child in case):
            file = "/".join(parts[: lengths[0]]) + ".py"
            found["::".join([file, *parts[lengths[0] :], case.get("name", "")])] = float(case.get("time", 0.0))
    return found


class Coverage:
    """Which tests reach a line of the package, as pytest-cov recorded it."""

    def __init__(self, path: Path | None) -> None:
        self.data: Any = None
        if path:
            from coverage import CoverageData

            self.data = CoverageData(str(path))
            self.data.read()

    def covering(self, mutant: Mutant, tests: Iterable[str]) -> set[str]:
        """The tests that reach its line, else its function, else its file."""
        files = self.data.measured_files() if self.data and not mutant.is_cpp else ()
        file = next((name for name in files if name.endswith(f"/bellcrank/{mutant.file}")), None)
        if file is None:
            return set()
        lines: dict[int, list[str]] = self.data.contexts_by_lineno(file)
        first, last = mutant.scope or (1, max(lines, default=1))
        for span in ((mutant.line, mutant.line), (first, last), (1, max(lines, default=1))):
            contexts = {c for line, some in lines.items() if span[0] <= line <= span[1] for c in some if "|" in c}
            named = {context.rpartition("|")[0] for context in contexts}
            # what one test sets up, the others of its file may share
            shared = {name.partition("::")[0] for name in (c.rpartition("|")[0] for c in contexts if "|setup" in c)}
            if found := {test for test in tests if test in named or test.partition("::")[0] in shared}:
                return found
        return set()


def plan(mutant: Mutant, seconds: dict[str, float], coverage: Coverage, reach: str) -> list[list[str]]:
    """The tests of each session: those that reach the line, the cheapest first; then the others that are wanted."""
    covering = coverage.covering(mutant, seconds)
    rooms = [f"tests/{room}/" for room in (*(FOR_CPP if mutant.is_cpp else (mutant.room,)), "machines", "commands")]
    near = {test for test in seconds if test.startswith((*rooms, f"tests/test_{mutant.room}.py"))}
    if reach == "covering" and covering:
        near = {test for test in near if test.startswith("tests/commands/")}
    others = set(seconds) - near if reach == "all" or not (covering or near) else set()
    cheap = sorted(covering or near, key=seconds.__getitem__)[:CHEAP]
    ordered = [cheap, _by_file(covering - set(cheap), seconds)]
    more = [_by_file(group - covering - set(cheap), seconds) for group in (near, others - near)]
    return [session for session in ([*ordered[0], *ordered[1]], [*more[0], *more[1]]) if session]


def _by_file(tests: set[str], seconds: dict[str, float]) -> list[str]:
    """Tests file by file, the quickest file first, so that what a file shares is made once."""
    total: defaultdict[str, float] = defaultdict(float)
    for test in tests:
        total[test.partition("::")[0]] += seconds[test]
    return sorted((test for test in seconds if test in tests), key=lambda test: total[test.partition("::")[0]])


def judged(
    mutant: Mutant, package: Path, builds: Builds, sessions: list[list[str]], seconds: dict[str, float]
) -> Record:
    """What becomes of a mutant: killed (by which test, and why), timed out, survived, or incompetent."""
    begun, count = time.monotonic(), 0
    record: Record = {"outcome": "survived", "by": "", "why": ""}
    with copied(package) as copy:
        if failed := applied(mutant, copy, builds):
            sessions, record["why"] = [], failed
            record |= {"outcome": "killed", "by": "the compiler"} if ASSERTION in failed else {"outcome": NOT_COUNTED}
        for tests in sessions:
            files = list(dict.fromkeys(test.partition("::")[0] for test in tests))
            run = run_tests(copy, ["-x", *files], tests, seconds)
            count += sum("ended" in entry for entry in run.log)
            first = next((entry for entry in run.log if "failed" in entry), None)
            if run.code is None:
                record |= {"outcome": "timed out", "by": run.last_begun}
            elif first:
                record |= {"outcome": "killed", "by": first["failed"], "why": first["why"]}
            elif run.code < 0:
                record |= {"outcome": "killed", "by": run.last_begun, "why": f"signal {-run.code}"}
            elif run.code != 0:
                raise SystemExit(f"pytest ends with {run.code} on {mutant.name}:\n{run.output[-3000:]}")
            if record["outcome"] != "survived":
                break
    return record | {"tests": count, "seconds": round(time.monotonic() - begun, 1)}


# ---- report


def table(mutants: list[Mutant], results: Results) -> str:
    """Rooms by kinds as "killed by tier 1 + by tier 2 alone / drawn", and the survivors with their lines."""

    def cell(chosen: Callable[[Mutant], bool]) -> str:
        some = [m for m in mutants if chosen(m)]
        first = sum(results.of(m).get(1, {}).get("outcome") in ("killed", "timed out") for m in some)
        every = sum(results.killed(m) for m in some)
        return f"{first}+{every - first}/{len(some)}" if some else ""

    rooms = sorted({m.room for m in mutants}, key=lambda room: ("/" in room, room))
    rows = [["", *KINDS, "all"]]
    for room in (*rooms, "all"):
        kinds = [lambda m, r=room, k=kind: m.kind in (k or m.kind) and r in (m.room, "all") for kind in (*KINDS, "")]
        rows.append([room, *(cell(chosen) for chosen in kinds)])
    lines = ["killed by tier 1 + by tier 2 alone / drawn"]
    lines += [f"{row[0]:<16}" + "".join(f"{entry:>12}" for entry in row[1:]) for row in rows]
    outcomes = Counter(record.get("outcome") for record in results.records)
    unknown = sum(not results.of(m) for m in mutants)
    lines.append(f"timed out {outcomes['timed out']}, drawn again {outcomes[NOT_COUNTED]}, not yet run {unknown}")
    survivors = [m for m in mutants if results.of(m) and not results.killed(m)]
    lines.append(f"survivors: {len(survivors)}")
    for mutant in survivors:
        lines += [f"  {mutant.name}", f"      {mutant.source.strip()}"]
    return "\n".join(lines)


def options() -> argparse.ArgumentParser:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=2026)
    parser.add_argument("--count", type=int, default=60, help="mutants (default 60)")
    parser.add_argument("--cpp", type=int, default=8, help="how many of them are C++ (default 8)")
    parser.add_argument("--list", action="store_true", help="print the mutants and what is known of them")
    parser.add_argument("--only", type=int, nargs="+", metavar="K", help="these of the list alone")
    parser.add_argument("--tier", type=int, choices=TIERS, default=1)
    parser.add_argument("--marker", help="marker expression of the tests instead of the tier's")
    parser.add_argument("--tests", nargs="+", default=["tests"], help="paths of the tests (default: all)")
    parser.add_argument("--survivors", action="store_true", help="only mutants that another tier did not kill")
    parser.add_argument("--coverage", type=Path, help="a file .coverage with contexts")
    parser.add_argument("--durations", type=Path, help="a JUnit file, instead of a run without mutants")
    parser.add_argument("--reach", choices=REACHES, default="all", help="which tests a mutant has to survive")
    parser.add_argument("--jobs", type=int, default=2, help="mutants at a time (default 2)")
    parser.add_argument("--out", type=Path, help="JSON lines: results; what is in it is not run again")
    parser.add_argument("--build", type=Path, default=ROOT / "build" / "mutants", help="folder of compiled C++")
    return parser


def main() -> None:
    """Run the command line."""
    args = options().parse_args()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    results, package = Results(args.out), installed()
    streams = [
        (drawn(python_places(package), args.seed), args.count - args.cpp),
        (drawn(cpp_places(ROOT / "src" / "cpp"), args.seed), args.cpp),
    ]
    mutants = selection(streams, results)
    if args.list:
        for k, mutant in enumerate(mutants, 1):
            known = ", ".join(f"tier {tier} {r['outcome']}" for tier, r in sorted(results.of(mutant).items()))
            print(f"{k:3} {mutant.name}{f'  [{known}]' if known else ''}\n      {mutant.source.strip()}")
        return
    marker = args.marker or TIERS[args.tier]
    seconds = junit_durations(args.durations) if args.durations else None
    if seconds is None:
        key = [args.tier, marker, args.tests]
        seconds = next((r["durations"] for r in results.records if r.get("baseline") == key), None)
    if seconds is None:
        seconds = baseline(package, args.tests, marker)
        results.add(baseline=key, durations=seconds)
    coverage, builds = Coverage(args.coverage), Builds(args.build)
    if args.cpp and (lacks := lacks_for_cpp()):
        raise SystemExit(f"mutants of C++ cannot be compiled without {', '.join(lacks)} (CONTRIBUTING.md); --cpp 0")

    def run(mutant: Mutant) -> None:
        record = judged(mutant, package, builds, plan(mutant, seconds, coverage, args.reach), seconds)
        results.add(mutant=mutant.name, tier=args.tier, source=mutant.source.strip(), **record)
        print(f"{record['outcome']:<12}{record['seconds']:7.0f} s  {mutant.name}  {record['by']}", flush=True)

    while True:
        mutants = selection(streams, results)
        chosen = [mutants[k - 1] for k in args.only] if args.only else mutants
        todo = [m for m in chosen if args.tier not in results.of(m) and not (args.survivors and results.killed(m))]
        if not todo:
            break
        with ThreadPoolExecutor(args.jobs) as pool:
            futures = [pool.submit(run, mutant) for mutant in todo]
            try:
                for future in as_completed(futures):
                    future.result()
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                end_all()
                raise
    print(table(mutants, results))


if __name__ == "__main__":
    main()
