"""What the last bits of results depend on besides the study: versions of packages, and the processor.

Code is compiled for a processor's SIMD lanes, and NumPy chooses its functions by the processor too: two processors may
round differently. BELLCRANK_TARGET and NPY_DISABLE_CPU_FEATURES make processors alike.
"""

from __future__ import annotations

import importlib.metadata
import os
from collections.abc import Mapping

import numpy as np

from bellcrank.codegen import cache
from bellcrank.codegen import llvm as machine
from bellcrank.codegen.compile import sources
from bellcrank.version import version

TARGET, FEATURES = "processor target", "NumPy's processor features"
TARGETS_ALIKE = (
    "results would differ in their last digits: start every worker with the same versions of the packages, and where "
    "processors differ with BELLCRANK_TARGET=avx2 (or baseline) and NPY_DISABLE_CPU_FEATURES naming what not all have"
)


def environment() -> dict[str, str]:
    """Versions and processor of this process, by a name that a user understands."""
    chosen = machine.target()
    found = {"bellcrank": f"{version()}, sources {sources()[:12]}"}
    found |= {name: importlib.metadata.version(name) for name in ("numpy", "scipy", "llvmlite")}
    found[TARGET] = f"{chosen.cpu}, {chosen.lanes} lanes, features {cache.digest(chosen.features)[:8]}"
    found[FEATURES] = _features()
    if os.environ.get("OPENBLAS_CORETYPE"):
        found["OPENBLAS_CORETYPE"] = os.environ["OPENBLAS_CORETYPE"]
    return found


def _features() -> str:
    try:
        enabled: Mapping[str, bool] = np._core._multiarray_umath.__cpu_features__  # type: ignore[attr-defined]
    except AttributeError:
        return "unknown"
    return " ".join(sorted(name for name, has in enabled.items() if has))


def differences(before: Mapping[str, str], now: Mapping[str, str], names: tuple[str, str]) -> str:
    """What differs between two identities, as a clause; empty where they are equal. `names` say what each one is."""
    found = []
    for key in dict.fromkeys([*before, *now]):
        one, other = before.get(key, "nothing"), now.get(key, "nothing")
        if one != other:
            one, other = _brief(one, other)
            found.append(f"{key} ({names[0]}: {one}; {names[1]}: {other})")
    return ", ".join(found)


def _brief(one: str, other: str) -> tuple[str, str]:
    """Two texts that differ, cut to where they do."""
    same = (k for k, pair in enumerate(zip(one, other, strict=False)) if pair[0] != pair[1])
    start = next(same, min(len(one), len(other)))
    start = max(start - 20, 0) if max(len(one), len(other)) > 80 else 0
    cut = [
        ("…" if start else "") + text[start : start + 60] + ("…" if len(text) > start + 60 else "")
        for text in (one, other)
    ]
    return cut[0], cut[1]
