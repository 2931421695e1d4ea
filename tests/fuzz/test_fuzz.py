"""Hostile inputs of every kind, made at random from a seed: refused in one sentence, or right to the last number.

BELLCRANK_FUZZ_CASES is how many cases a kind has (default 25), BELLCRANK_FUZZ_SEED the seed (default 1); a failure is
printed with the line that runs its case again.
"""

import os
from pathlib import Path

import fuzz_inputs
import fuzz_run
import pytest

pytestmark = pytest.mark.tier2

CASES = int(os.environ.get("BELLCRANK_FUZZ_CASES", "25"))
SEED = int(os.environ.get("BELLCRANK_FUZZ_SEED", "1"))


@pytest.mark.parametrize("kind", fuzz_inputs.KINDS)
def test_hostile_inputs_are_refused_in_one_sentence_or_give_finite_results(kind):
    verdicts, failures = fuzz_run.fuzz(kind, SEED, CASES)
    assert not failures, f"{kind}: {dict(verdicts)}\n" + "\n".join(map(str, failures))
    assert sum(verdicts.values()) == CASES
    if CASES >= 25 and kind not in ("mesh", "argument"):  # else it would test the readers alone, or nothing hostile
        assert verdicts["accepted"] >= 1 and verdicts["refused"] >= 1, verdicts


@pytest.mark.parametrize("kind", fuzz_inputs.KINDS)
def test_a_case_is_made_of_kind_seed_and_number_alone(kind):
    first, again = fuzz_inputs.case(kind, 5, 3), fuzz_inputs.case(kind, 5, 3)
    assert first.files == again.files and repr(first) == repr(again)
    assert repr([fuzz_inputs.case(kind, 5, n) for n in range(20)]) != repr(
        [fuzz_inputs.case(kind, 6, n) for n in range(20)]
    )


FAULTS = {
    "traceback": "traceback: KeyError",
    "hang": "hang: no answer within",
    "crash": "crash: SIGSEGV",
    "memory": "traceback: MemoryError",
    "hidden": "left a hidden file",
    "noise": "warning on the terminal",
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_found_named_and_the_cases_after_it_are_done(fault):
    """The net itself: in case 1 of a kind."""
    verdicts, failures = fuzz_run.fuzz(f"fault {fault}", 1, 4, seconds=6.0)
    assert verdicts == {"accepted": 3, "failed": 1}
    (failure,) = failures
    assert failure.what.startswith(FAULTS[fault]) and (failure.number, failure.count) == (1, 1)
    assert str(failure).endswith(f"{Path(fuzz_run.__file__).resolve()} 'fault {fault}' 1 1")
