"""Every test session compiles into a cache of its own, so that no earlier run can lend it an answer."""

import os
import tempfile

import pytest

_folder = tempfile.TemporaryDirectory(prefix="bellcrank-tests-")
os.environ["BELLCRANK_CACHE"] = os.path.join(_folder.name, "cache")
os.environ["MPLBACKEND"] = "Agg"


@pytest.fixture
def fresh_cache(tmp_path, monkeypatch):
    """An empty cache folder, and the path it will have."""
    where = tmp_path / "cache"
    monkeypatch.setenv("BELLCRANK_CACHE", str(where))
    return where
