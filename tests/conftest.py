"""Every test session compiles into a cache of its own, so that no earlier run can lend it an answer."""

import os
import re
import signal
import tempfile
from collections import Counter

import pytest
import work

pytest.register_assert_rewrite("properties")

if "PYTEST_XDIST_WORKER" in os.environ:  # the folder is the session's, and so that of all its workers
    # OpenBLAS starts a thread for each core, which wait for those of the other workers while they spin.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
else:
    _folder = tempfile.TemporaryDirectory(prefix="bellcrank-tests-")
    os.environ["BELLCRANK_CACHE"] = os.path.join(_folder.name, "cache")
    os.environ["XDG_STATE_HOME"] = os.path.join(_folder.name, "state")
os.environ["MPLBACKEND"] = "Agg"
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as shells start what runs behind; tests press Ctrl-C
    signal.signal(signal.SIGINT, signal.default_int_handler)

_WHOLLY_TIER2 = re.compile(r"^pytestmark = pytest\.mark\.tier2$", re.MULTILINE)
_BEFORE = pytest.StashKey[Counter[str]]()


@pytest.hookimpl(trylast=True)
def pytest_sessionstart(session):
    """Count the work of tests, but in the process that only hands them out: there the imports would cost seconds.

    A worker's coverage begins at this point too, and would not see the lines of modules that were imported before it.
    """
    if "PYTEST_XDIST_WORKER" in os.environ or session.config.getoption("dist", "no") == "no":
        import hypothesis

        hypothesis.settings.register_profile("seeded", derandomize=True, deadline=None)
        hypothesis.settings.load_profile("seeded")
        work.watch()


def pytest_ignore_collect(collection_path, config):
    """Leave out files of the second tier alone while the first one runs, since reading them costs seconds.

    pytest does not ask about a file that is named on the command line: that is read, and its tests are deselected.
    """
    if config.option.markexpr == "not tier2" and re.fullmatch(r"test_\w+\.py", collection_path.name):
        return True if _WHOLLY_TIER2.search(collection_path.read_text(encoding="utf-8")) else None
    return None


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item, nextitem):
    """Each case begins with nothing spent, and a case of the first tier ends within the budget of work."""
    item.stash[_BEFORE] = Counter(work.done)
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    result = yield
    if excess := item.get_closest_marker("tier2") is None and work.excess(item.stash[_BEFORE]):
        pytest.fail(f"too much work for the first tier: {'; '.join(excess)}. Do less, or mark it tier2", pytrace=False)
    return result


@pytest.fixture
def fresh_cache(tmp_path, monkeypatch):
    """An empty cache folder, and the path that what is in it will have."""
    import bellcrank as bc

    bc.wait_for_optimised_code()  # what earlier tests began to compile is not kept here
    where = tmp_path / "cache"
    monkeypatch.setenv("BELLCRANK_CACHE", str(where))
    return where / "bellcrank-cache-2"
