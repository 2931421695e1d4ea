"""Every test session compiles into a cache of its own, so that no earlier run can lend it an answer."""

import os
import signal
import tempfile

import pytest

_folder = tempfile.TemporaryDirectory(prefix="bellcrank-tests-")
os.environ["BELLCRANK_CACHE"] = os.path.join(_folder.name, "cache")
os.environ["XDG_STATE_HOME"] = os.path.join(_folder.name, "state")
os.environ["MPLBACKEND"] = "Agg"
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as shells start what runs behind; tests press Ctrl-C
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def fresh_cache(tmp_path, monkeypatch):
    """An empty cache folder, and the path that what is in it will have."""
    where = tmp_path / "cache"
    monkeypatch.setenv("BELLCRANK_CACHE", str(where))
    return where / "bellcrank-cache-2"
