"""Every test session compiles into a cache of its own, so that no earlier run can lend it an answer."""

import os
import signal
import tempfile
from collections import Counter

import hypothesis
import pytest
import work

pytest.register_assert_rewrite("properties")
hypothesis.settings.register_profile("seeded", derandomize=True, deadline=None)
hypothesis.settings.load_profile("seeded")

_folder = tempfile.TemporaryDirectory(prefix="bellcrank-tests-")
os.environ["BELLCRANK_CACHE"] = os.path.join(_folder.name, "cache")
os.environ["XDG_STATE_HOME"] = os.path.join(_folder.name, "state")
os.environ["MPLBACKEND"] = "Agg"
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as shells start what runs behind; tests press Ctrl-C
    signal.signal(signal.SIGINT, signal.default_int_handler)
work.watch()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item, nextitem):
    """Each case begins with nothing spent, and a case of the first tier ends within the budget of work."""
    item.stash[_BEFORE] = Counter(work.done)
    return (yield)


_BEFORE = pytest.StashKey[Counter[str]]()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    result = yield
    if excess := item.get_closest_marker("tier2") is None and work.excess(item.stash[_BEFORE]):
        pytest.fail(f"too much work for the first tier: {'; '.join(excess)}. Do less, or mark it tier2", pytrace=False)
    return result


@pytest.fixture
def fresh_cache(tmp_path, monkeypatch):
    """An empty cache folder, and the path that what is in it will have."""
    where = tmp_path / "cache"
    monkeypatch.setenv("BELLCRANK_CACHE", str(where))
    return where / "bellcrank-cache-2"
