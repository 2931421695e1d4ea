"""A process that is forked while other threads compile works: no lock stays taken in it."""

import os
import subprocess
import sys
import textwrap

import pytest

pytestmark = pytest.mark.tier2

SCRIPT = """
    import faulthandler, os, sys, threading, time
    import bellcrank as bc

    names, done = ["planar_2r_swing", "spring_pendulum", "pendulum"], threading.Event()

    def work(first):
        k = first
        while not done.is_set():
            k += 3
            outputs = {"outputs": {"x": {"expression": f"{k} * sin(t)"}}}  # which no cache has
            bc.simulate(names[k % 3], duration=0.01, samples=2, overrides=outputs)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(3)]
    [thread.start() for thread in threads]
    children = []
    for k in range(10):
        time.sleep(0.05)
        child = os.fork()
        if not child:
            faulthandler.dump_traceback_later(60, exit=True)
            try:
                outputs = {"outputs": {"y": {"expression": f"{k} * cos(t)"}}}
                ended = bc.simulate(names[k % 3], duration=0.02, samples=2, overrides=outputs)
                os._exit(0 if ended.success else 3)
            except BaseException as error:
                print(repr(error), flush=True)
                os._exit(4)
        children.append(child)
    done.set()
    [thread.join() for thread in threads]
    print([os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in children])
"""
INSIDE = """
    import faulthandler, os, threading
    os.environ["BELLCRANK_CACHE"] = "off"  # else a quick child leaves the parent nothing to compile
    import bellcrank as bc
    from bellcrank.codegen.locks import making

    parent, held = os.getpid(), []

    def own(symbols):  # which forks in the middle of what this thread itself traces and compiles
        if os.getpid() == parent and threading.current_thread() is threading.main_thread():
            held.append((making._is_owned(), os.fork()))
            if not held[-1][1]:
                faulthandler.dump_traceback_later(60, exit=True)
        return symbols.joint("shoulder").position - symbols.joint("elbow").position

    scene = bc.load_scene("planar_2r_swing", {"initial": {"shoulder": 0.4, "elbow": 0.4}})
    ended = bc.simulate(scene.with_constraint(own), duration=0.01, samples=2)
    if os.getpid() != parent:
        os._exit(0 if ended.success else 3)
    states = [os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for _, child in held]
    print(ended.success, any(states), any(owned for owned, _ in held))
"""
MEANWHILE = """
    import faulthandler, os, sys, threading, time
    from bellcrank.codegen.locks import making

    assert "llvmlite" not in sys.modules
    made, forks = threading.Event(), threading.Event()

    def work():
        with making:
            made.set()
            forks.wait()
            time.sleep(0.2)  # until the fork waits for `making`
            from llvmlite.binding.ffi import lib
            lib._lock.__enter__()
        time.sleep(0.2)  # for a fork that does not wait for llvmlite's lock
        lib._lock.__exit__()

    thread = threading.Thread(target=work)
    thread.start()
    made.wait()
    os.register_at_fork(before=forks.set)
    child = os.fork()
    if not child:
        faulthandler.dump_traceback_later(20, exit=True)
        import llvmlite.binding
        llvmlite.binding.initialize_native_target()
        os._exit(0)
    thread.join()
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


def run(script):
    command = [sys.executable, "-c", textwrap.dedent(script)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, env=os.environ)
    assert done.returncode == 0, done.stderr
    return done


def test_children_forked_while_threads_compile_compile_and_run(fresh_cache):
    done = run(SCRIPT)
    assert done.stdout == f"{[0] * 10}\n" and not done.stderr, done.stdout + done.stderr  # where a child hung


def test_a_fork_in_the_middle_of_ones_own_compilation_leaves_both_processes_able_to_go_on():
    done = run(INSIDE)
    assert done.stdout == "True False True\n", done.stdout + done.stderr


def test_a_fork_holds_the_lock_of_llvmlite_that_is_imported_while_it_waits():
    done = run(MEANWHILE)
    assert done.stdout == "0\n", done.stdout + done.stderr


def test_values_computed_once_do_not_wait_for_each_other():
    """functools.cached_property of Python 3.11 holds a lock of the class: one object's value stopped all others'."""
    import threading

    from bellcrank.cached_values import cached_property

    class Thing:
        entered, leave = threading.Event(), threading.Event()

        def __init__(self, slow):
            self.slow = slow

        @cached_property
        def value(self):
            """What it is."""
            if self.slow:
                self.entered.set()
                assert self.leave.wait(30)
            return object()

    slow, quick = Thing(True), Thing(False)
    thread = threading.Thread(target=lambda: slow.value)
    thread.start()
    assert slow.entered.wait(30)
    found = []
    other = threading.Thread(target=lambda: found.append(quick.value))
    other.start()
    other.join(30)
    slow.leave.set()
    thread.join(30)
    assert found == [quick.value] and slow.value is slow.value and Thing.value.__doc__ == "What it is."
