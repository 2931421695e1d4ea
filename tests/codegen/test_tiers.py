"""Code that is compiled quickly first, when first called, and optimised in another process meanwhile."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import casadi
import numpy as np
import pytest

import bellcrank as bc
from bellcrank.codegen import compile as compile_module
from bellcrank.codegen import full_tier
from bellcrank.codegen import llvm as machine
from bellcrank.codegen.compile import compiled
from bellcrank.dynamics.equations.system import system_of
from bellcrank.errors import CompileError


def long_function(name="long", terms=600):
    """About 6 operations a term, all of which matter, in no order that repeats itself."""

    def build():
        x = casadi.SX.sym("x", 8)
        y, random = casadi.sin(x[0]), np.random.default_rng(terms)
        for _ in range(terms):
            a, b = (x[int(k)] for k in random.integers(0, 8, 2))
            root, ratio = casadi.sqrt(1 + y * y) * a, random.random() / (1.1 + y * y)
            y = [root - ratio + b, ratio + b * root, b - root, ratio * a - root * b][random.integers(4)]
        return casadi.Function("long", [x], [casadi.vertcat(y, x)])

    return compiled(name, ("test", str(terms)), build)


def samples():
    return np.random.default_rng(0).normal(size=(20, 8))


def levels(monkeypatch):
    """The levels of what this process compiles from now on."""
    made, compile_ir = [], machine.object_code
    monkeypatch.setattr(machine, "object_code", lambda ir, t, level=2: made.append(level) or compile_ir(ir, t, level))
    return made


def test_long_code_runs_at_once_and_its_optimised_code_takes_over_with_the_same_bits(fresh_cache, monkeypatch):
    made, function, x = levels(monkeypatch), long_function(), samples()
    single, many = [function(row) for row in x], function(x)
    address, before = function.address("scalar"), function.code("scalar")._loaded[-1].address
    assert [level for level in made if level == 0] == [0, 0]
    assert full_tier.wait_for_optimised_code(100)
    assert function.address("scalar") == address and function.code("scalar")._loaded[-1].address != before
    np.testing.assert_array_equal([function(row) for row in x], single)
    np.testing.assert_array_equal(function(x), many)
    made.clear()
    again = long_function()  # as another process finds it
    np.testing.assert_array_equal([again(row) for row in x], single)
    np.testing.assert_array_equal(again(x), many)
    assert not made and not again.code("scalar")._entry


def test_a_long_batch_goes_over_to_the_optimised_code_with_the_same_bits(fresh_cache, monkeypatch):
    monkeypatch.setattr(compile_module, "BLOCK", 16)
    function, x = long_function("swapped"), np.random.default_rng(2).normal(size=(16 * 9 + 5, 8))
    code, called = function.code("batch"), []
    prepared = type(function).prepared

    def counted(self, arrays, outputs):
        called.append(len(outputs[0]))
        if len(called) == 3:
            assert full_tier.wait_for_optimised_code(100)
        return prepared(self, arrays, outputs)

    monkeypatch.setattr(type(function), "prepared", counted)
    function.address("batch")
    assert code.is_improving
    many = function(x)
    assert not code.is_improving and called == [16, 16, 16, 16 * 6 + 5]  # the rest at once
    np.testing.assert_array_equal(function(x), many)
    np.testing.assert_array_equal(function(x[:20]), many[:20])


def test_quickly_compiled_code_is_cached_until_optimised_code_is(fresh_cache, monkeypatch):
    monkeypatch.setattr(full_tier, "ask", lambda *_: None)  # as where the program ends before
    row = samples()[0]
    first = long_function()(row)
    monkeypatch.undo()
    monkeypatch.setenv("BELLCRANK_CACHE", str(fresh_cache.parent))
    made, function = levels(monkeypatch), long_function()
    np.testing.assert_array_equal(function(row), first)
    assert 0 not in made
    assert full_tier.wait_for_optimised_code(100)
    np.testing.assert_array_equal(function(row), first)
    assert len(function.code("scalar")._loaded) == 2


def in_optimiser():
    return threading.current_thread().name == "bellcrank-optimiser"


def raised(error):
    raise error


@pytest.mark.tier2
@pytest.mark.parametrize("reason", ["no interpreter", "it fails", "its code cannot be loaded"])
def test_quickly_compiled_code_stays_where_the_compiling_process_cannot_help(
    reason, fresh_cache, monkeypatch, tmp_path
):
    full_tier._optimiser.end()
    monkeypatch.setattr(full_tier, "_optimiser", full_tier._Optimiser())
    if reason == "no interpreter":
        monkeypatch.setattr(sys, "executable", str(tmp_path / "none"))
    elif reason == "its code cannot be loaded":
        refuse, load = RuntimeError("no memory for code"), machine.Loaded
        monkeypatch.setattr(machine, "Loaded", lambda *code: raised(refuse) if in_optimiser() else load(*code))
    else:
        monkeypatch.setattr(full_tier.object_code, "__file__", str(tmp_path / "none.py"))
    function, row = long_function(), samples()[0]
    first = function(row)
    assert full_tier.wait_for_optimised_code(100)
    assert len(function.code("scalar")._loaded) == 1
    np.testing.assert_array_equal(function(row), first)


def test_short_code_is_optimised_at_once_and_seldom_called_long_code_never(fresh_cache, monkeypatch):
    made = levels(monkeypatch)
    x = casadi.SX.sym("x", 2)
    compiled("short", ("test",), lambda: casadi.Function("short", [x], [x[0] * x[1]]))(np.ones(2))
    assert made == [2]
    seldom = compiled("seldom", ("test",), lambda: casadi.Function.deserialize(serialised()), seldom=True)
    seldom(samples()[0])
    assert made == [2, 0] and full_tier.wait_for_optimised_code(100)
    assert len(seldom.code("scalar")._loaded) == 1


def serialised():
    return casadi.Function("sums", [x := casadi.SX.sym("x", 8)], [casadi.vertcat(*chain(x))]).serialize()


def chain(x):
    y = x[0]
    for k in range(700):
        y = y * x[k % 8] + casadi.sqrt(1 + y * y) / (k + 1)
        yield y if k % 70 == 0 else x[1]


def test_a_function_that_many_threads_call_is_compiled_once(fresh_cache, monkeypatch):
    from concurrent.futures import ThreadPoolExecutor

    made, function, x = levels(monkeypatch), long_function("threads"), samples()
    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(function, [*x] * 5))
    assert made.count(0) == 1
    np.testing.assert_array_equal(answers, [function(row) for row in x] * 5)


# ---- code that is compiled when the integrator first calls it


def fresh(monkeypatch):
    from bellcrank.dynamics.constraints import constraint_rows
    from bellcrank.dynamics.equations import system

    system._recent.clear(), system._systems.clear(), constraint_rows._samplers.clear(), constraint_rows._known.clear()


def is_made(function, kind="scalar"):
    return function.code(kind).is_made


def test_a_run_compiles_only_what_it_calls(fresh_cache, monkeypatch):
    fresh(monkeypatch)
    scene = bc.load_scene("four_bar")
    run = bc.simulate(scene, duration=0.05, samples=3)
    system = system_of(scene)
    assert run.success and is_made(system.stage) and is_made(system.project)
    assert not is_made(system.fallback_stage) and not is_made(system.project_fallback)
    assert not system.fallback_stage._found  # nor is it traced


def test_a_fallback_that_is_compiled_in_the_middle_of_a_run_gives_the_same_bits(fresh_cache, monkeypatch):
    fresh(monkeypatch)
    scene = bc.load_scene("bricard")  # its rows are redundant
    run = bc.simulate(scene, duration=0.05, samples=5)
    assert run.success and is_made(system_of(scene).fallback_stage)
    again = bc.simulate(scene, duration=0.05, samples=5)
    np.testing.assert_array_equal(again.state, run.state)


@pytest.mark.tier2
def test_threads_of_an_ensemble_compile_what_they_first_need(fresh_cache, monkeypatch):
    angles = {"initial.crank": [f"{1 + 0.1 * k} deg" for k in range(20)]}
    times = []
    for threads in (3, 1):
        fresh(monkeypatch)
        monkeypatch.setenv("BELLCRANK_CACHE", str(fresh_cache.parent / str(threads)))
        times.append(bc.sweep("four_bar", angles, threads=threads).column("lock.time"))
    assert np.isfinite(times[0]).all()
    np.testing.assert_array_equal(times[0], times[1])


def test_an_error_in_compiling_during_a_run_is_raised(fresh_cache, monkeypatch):
    fresh(monkeypatch)
    scene = bc.load_scene("four_bar")

    def refused():
        raise CompileError("no code today")

    monkeypatch.setattr(system_of(scene).project, "_graph", refused)
    with pytest.raises(CompileError, match="no code today"):
        bc.simulate(scene, duration=0.05)
    monkeypatch.undo()
    fresh(monkeypatch)  # the equations whose code was refused are not those of other tests


# ---- Ctrl-C, forks and the end of the program

BEGIN = """
    import os, signal, sys, threading, time
    import numpy as np
    sys.path.insert(0, {here!r})
    from test_tiers import *
    from bellcrank.codegen import machine_code
"""


def in_a_process(code, folder, **more):
    text = textwrap.dedent(BEGIN.format(here=str(Path(__file__).parent))) + textwrap.dedent(code)
    environment = os.environ | {"BELLCRANK_CACHE": str(folder)}
    return subprocess.Popen(
        [sys.executable, "-c", text], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, **more
    )


def is_running(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"


def ended_within(pid, seconds):
    end = time.monotonic() + seconds
    while is_running(pid) and time.monotonic() < end:
        time.sleep(0.05)
    return not is_running(pid)


COMPILING = """
    function = long_function("huge", 12000)
    function(samples()[0])
    while full_tier._optimiser._process is None:
        time.sleep(0.01)
    time.sleep(0.5)
    print(full_tier._optimiser._process.pid, full_tier._optimiser._left, flush=True)
"""


@pytest.mark.tier2
@pytest.mark.parametrize("how", ["end", "os._exit(0)", "sys.exit(0)", "os.kill(os.getpid(), signal.SIGKILL)"])
def test_the_program_ends_at_once_while_code_is_optimised_and_leaves_nothing(how, fresh_cache):
    program = in_a_process(COMPILING + ("" if how == "end" else f"    {how}\n"), fresh_cache.parent)
    pid, left = map(int, program.stdout.readline().split())
    kept = set(fresh_cache.glob("[!t]*"))
    _, errors = program.communicate(timeout=60)
    assert left == 1 and not errors and program.returncode == (-signal.SIGKILL if "KILL" in how else 0)
    assert set(fresh_cache.glob("[!t]*")) == kept  # it did not wait for the optimised code
    assert ended_within(pid, 10.0)
    assert not list(fresh_cache.glob("temporary-*"))


@pytest.mark.tier2
def test_ctrl_c_during_a_run_waits_for_code_that_is_being_compiled_and_ends_the_run(fresh_cache):
    code = """
        scene = bc.load_scene("four_bar")
        function, begun = system_of(scene).project, []
        graph = function._graph
        def slow():
            if not begun:
                begun.append(threading.current_thread() is threading.main_thread())
                os.kill(os.getpid(), signal.SIGINT)
                time.sleep(0.3)
            return graph()
        function._graph = slow
        run = bc.simulate(scene, duration=1e6, max_evaluations=10**9)
        print(run.status.name, begun, np.isfinite(run.state).all(), function.code("scalar").is_made)
    """
    program = in_a_process(code, fresh_cache.parent)
    out, errors = program.communicate(timeout=120)
    assert out.split() == ["INTERRUPTED", "[False]", "True", "True"], errors
    assert not errors


@pytest.mark.tier2
def test_a_forked_process_optimises_its_own_code(fresh_cache):
    code = """
        function, row = long_function("forked", 1500), samples()[0]
        first = function(row)
        child = os.fork()
        if not child:
            own = long_function("own", 800)
            own(row)
            good = full_tier.wait_for_optimised_code(100) and len(own.code("scalar")._loaded) == 2
            os._exit(0 if good and (function(row) == first).all() else 3)
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), full_tier.wait_for_optimised_code(100))
        print((function(row) == first).all(), len(function.code("scalar")._loaded))
    """
    program = in_a_process(code, fresh_cache.parent)
    out, errors = program.communicate(timeout=120)
    assert out.split() == ["0", "True", "True", "2"] and not errors, errors
