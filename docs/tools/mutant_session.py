"""A plugin of pytest for the sessions that mutants.py starts: it runs given tests in a given order, and keeps a log.

The environment variable BELLCRANK_MUTANT names a JSON file: `package` is the file that `bellcrank` has to be imported
from, `tests` the node ids in the order in which they run (null: all that are collected), `log` the file of the log.
"""

from __future__ import annotations

import json
import os
import resource
from pathlib import Path
from typing import Any

import pytest

MEMORY = 8 << 30  # bytes; a faulty length must not take the memory of the whole machine
ORDER = json.loads(Path(os.environ["BELLCRANK_MUTANT"]).read_text("utf-8"))
SECONDS: dict[str, float] = {}  # of the parts of the test that runs


def _log(**entry: Any) -> None:
    with Path(ORDER["log"]).open("a", encoding="utf-8") as file:
        file.write(json.dumps(entry) + "\n")


def pytest_configure(config: pytest.Config) -> None:
    """Limit the memory of this process and of those that it starts."""
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, resource.getrlimit(resource.RLIMIT_DATA)[1]))


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep the tests that are to run, in their order; end the session if another package would be tested."""
    import work

    import bellcrank

    if bellcrank.__file__ is None or not Path(bellcrank.__file__).samefile(ORDER["package"]):
        pytest.exit(f"bellcrank is {bellcrank.__file__}, not {ORDER['package']}", returncode=9)
    # in another order another test does the work that several share: how much one may do is not asked
    work.BUDGET.clear()
    if ORDER["tests"] is not None:
        known = {item.nodeid: item for item in items}
        items[:] = [known[test] for test in ORDER["tests"] if test in known]


def pytest_collectreport(report: pytest.CollectReport) -> None:
    """Log a file of tests that cannot be imported."""
    if report.failed:
        _log(failed=f"collection of {report.nodeid}", why=_reason(report))


def pytest_runtest_logstart(nodeid: str) -> None:
    """Log the test that begins, so that the one that never ends is known."""
    SECONDS[nodeid] = 0.0
    _log(begins=nodeid)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Log a failure, and the time of a test that has ended."""
    SECONDS[report.nodeid] += report.duration
    if report.failed:
        _log(failed=report.nodeid, why=_reason(report))
    if report.when == "teardown":
        _log(ended=report.nodeid, seconds=round(SECONDS[report.nodeid], 3))


def _reason(report: pytest.CollectReport | pytest.TestReport) -> str:
    crash = getattr(report.longrepr, "reprcrash", None)
    return (crash.message if crash else str(report.longrepr).strip().splitlines()[-1]).strip().split("\n")[0][:200]
