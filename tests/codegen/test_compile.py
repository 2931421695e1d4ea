"""From graph to machine code: every operation, every target, and a cache that never breaks a run."""

import os
import stat
import subprocess
import sys
import textwrap

import casadi
import numpy as np
import pytest

import bellcrank as bc
from bellcrank.codegen import cache, llvm_ir
from bellcrank.codegen import llvm as machine
from bellcrank.codegen.compile import compiled
from bellcrank.errors import CompileError, InputError

TARGETS = ["native", "avx2", "baseline"]


def every_operation():
    x = casadi.SX.sym("x", 2)
    a, b = x[0], x[1]
    unary = [casadi.exp, casadi.log, casadi.sqrt, casadi.sin, casadi.cos, casadi.tan, casadi.asin, casadi.acos,
             casadi.atan, casadi.sinh, casadi.cosh, casadi.tanh, casadi.floor, casadi.ceil, casadi.fabs,
             casadi.sign, casadi.log1p, casadi.expm1]  # fmt: skip
    binary = [a + b, a - b, a * b, a / b, a**b, a**3.5, casadi.fmin(a, b), casadi.fmax(a, b), casadi.atan2(a, b),
              casadi.hypot(a, b), casadi.fmod(a, b), casadi.copysign(a, -b), -a, 1 / a, 2 * a, a * a]  # fmt: skip
    logic = [a < b, a <= b, a == b, a != b, casadi.logic_not(a < b), casadi.logic_and(a < b, a < 0.5),
             casadi.logic_or(a < b, a < 0.5), casadi.if_else(a < b, a, b)]  # fmt: skip
    return casadi.Function("all", [x], [casadi.vertcat(*[f(a) for f in unary], *binary, *logic)])


@pytest.mark.parametrize("target", TARGETS)
def test_every_operation_equals_casadis_own_interpreter(target, monkeypatch):
    monkeypatch.setenv("BELLCRANK_TARGET", target)
    function = every_operation()
    code = compiled("all", ("test",), lambda: function)
    x = np.random.default_rng(2).uniform(0.05, 0.95, (37, 2))
    expected = np.array(function(x.T)).T
    np.testing.assert_allclose(code(x), expected, rtol=2e-15, atol=1e-16)
    np.testing.assert_allclose(code(x[0]), expected[0], rtol=2e-15, atol=1e-16)


@pytest.mark.parametrize("target", TARGETS)
def test_every_target_gives_the_same_dynamics(target, monkeypatch):
    robot = bc.load_robot("panda", friction="none")
    random = np.random.default_rng(1)
    q, v, a = (random.normal(size=(50, n)) for n in (robot.nq, robot.nv, robot.nv))
    expected = robot.inverse_dynamics(q, v, a)
    monkeypatch.setenv("BELLCRANK_TARGET", target)
    np.testing.assert_allclose(robot.inverse_dynamics(q, v, a), expected, atol=1e-12)


def test_an_unknown_target_is_named(monkeypatch):
    monkeypatch.setenv("BELLCRANK_TARGET", "avx3")
    with pytest.raises(InputError, match=r"BELLCRANK_TARGET: unknown target 'avx3'.*avx2"):
        machine.target()


def test_structural_zeros_of_an_output_are_written():
    x = casadi.SX.sym("x", 1)
    sparse = casadi.SX(3, 1)
    sparse[1] = x * 2
    code = compiled("sparse", ("test",), lambda: casadi.Function("sparse", [x], [sparse]))
    assert code(np.array([4.0])).tolist() == [0.0, 8.0, 0.0]
    assert code(np.full((9, 1), 4.0)).tolist() == [[0.0, 8.0, 0.0]] * 9


def test_a_single_sample_is_repeated_over_a_batch():
    x, y = casadi.SX.sym("x", 2), casadi.SX.sym("y", 3)
    code = compiled("mixed", ("test",), lambda: casadi.Function("mixed", [x, y], [casadi.sum1(x) * y]))
    batch = np.arange(30.0).reshape(10, 3)
    np.testing.assert_array_equal(code(np.array([1.0, 2.0]), batch), 3 * batch)


def test_arrays_of_the_wrong_shape_are_refused():
    x = casadi.SX.sym("x", 2)
    code = compiled("shape", ("test",), lambda: casadi.Function("shape", [x], [x]))
    with pytest.raises(InputError, match=r"shape \(3,\), expected \(2,\) or \(n, 2\)"):
        code(np.zeros(3))
    with pytest.raises(InputError, match="takes 1 arrays, 2 were given"):
        code(np.zeros(2), np.zeros(2))


def test_an_operation_without_machine_code_is_a_clear_error():
    x = casadi.SX.sym("x", 1)
    with pytest.raises(CompileError, match="cannot be compiled"):
        compiled("erf", ("test",), lambda: casadi.Function("erf", [x], [casadi.erf(x)]))([0.5])


# ---- orders, cuts and shared reciprocals


def cut_into_pieces(monkeypatch, operations):
    monkeypatch.setattr(llvm_ir, "WHOLE", operations)
    monkeypatch.setattr(llvm_ir, "PART", operations)


def random_graph(seed):
    """Sums, products, quotients and nested sines of values near and far, all read; the last input may be large."""
    random = np.random.default_rng(seed)
    x = casadi.SX.sym("x", 5)
    values = [*casadi.vertsplit(x[:4]), casadi.sin(x[4]), casadi.cos(3 * x[4]), casadi.SX(0.75)]
    for _ in range(300):
        near = values[-int(random.integers(1, min(len(values), random.choice([5, 40, 400])) + 1))]
        far = values[int(random.integers(len(values)))]
        kind = random.integers(6)
        made = (near + far) / 2, (near - far) / 2, near * far / (1 + near * near), near / (2 + far * far)
        values.append([*made, casadi.sin(near + far), casadi.cos(near)][kind])
    picked = [values[i] for i in random.integers(0, len(values), 20)]
    return casadi.Function("random", [x], [casadi.vertcat(*picked, 0, 3.5, x[2]), sum(values)])


@pytest.mark.tier2
@pytest.mark.parametrize("target", TARGETS)
def test_code_cut_into_pieces_gives_the_same_numbers(target, monkeypatch):
    monkeypatch.setenv("BELLCRANK_TARGET", target)
    cut_into_pieces(monkeypatch, 40)
    for seed in range(4):
        function = random_graph(seed)
        code = compiled("random", ("test", str(seed), "cut"), lambda f=function: f)
        assert "@part5" in code.ir("scalar") and "@part5" in code.ir("batch")
        x = np.random.default_rng(seed).normal(size=(19, 5))
        x[3, 4] *= 1e7  # sines by the C library
        for k, expected in enumerate(function(x.T)):
            np.testing.assert_allclose(code(x)[k], np.array(expected).T, rtol=1e-11, atol=1e-11)
            np.testing.assert_allclose(code(x[3])[k], np.array(expected).T[3], rtol=1e-11, atol=1e-11)
            np.testing.assert_allclose(code(x[0])[k], np.array(expected).T[0], rtol=1e-11, atol=1e-11)


def test_pieces_of_code_keep_apart_what_threads_compute(monkeypatch):
    from concurrent.futures import ThreadPoolExecutor

    cut_into_pieces(monkeypatch, 100)
    robot = bc.load_robot("ur5", friction="none", gravity=(0.1, 0.2, -9.7))
    states = np.random.default_rng(0).normal(size=(3, 4000, 6))
    expected = robot.forward_dynamics(*states)
    assert "@part9" in robot.dynamics("forward_dynamics").ir("batch")
    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(lambda k: robot.forward_dynamics(*states[:, k::4]), range(4)))
    for k, answer in enumerate(answers):
        np.testing.assert_array_equal(answer, expected[k::4])


@pytest.mark.tier2
@pytest.mark.parametrize("length", [10**9, 30])
def test_every_value_is_computed_before_it_is_read_and_kept_until_its_last_reading(length, monkeypatch):
    """Runs the plan on paper: a slot must hold the very value that a later piece reads from it."""
    cut_into_pieces(monkeypatch, length)
    for seed in range(5):
        graph = compiled("random", ("test", str(seed)), lambda seed=seed: random_graph(seed)).graph
        plan, nodes = llvm_ir.schedule(graph), graph.nodes
        sines = {}
        for index, node in enumerate(nodes):
            if node.op in ("sin", "cos"):
                sines.setdefault(node.args[0], []).append(index)
        assert plan.memory <= len(plan.slots)
        memory, written = {}, set()
        for part in plan.parts:
            own = set()
            for step in part:
                for index in nodes[step].args if step >= 0 else plan.waves[-1 - step]:
                    if nodes[index].args and index not in own:
                        assert memory[plan.slots[index]] == index
                for index in [step] if step >= 0 else [i for a in plan.waves[-1 - step] for i in sines[a]]:
                    assert index not in written
                    own.add(index)
                    written.add(index)
                    if index in plan.slots:
                        memory[plan.slots[index]] = index
        wanted = {int(n) for _, _, stored in graph.outputs for n in stored if nodes[n].args}
        assert wanted <= written


def test_reordering_shortens_how_long_values_wait():
    """Talos' inverse dynamics as casadi orders it keeps hundreds of values at once; a recursion needs far fewer."""
    graph = bc.load_robot("talos", floating_base=True, friction="none").dynamics("inverse_dynamics").graph
    nodes = graph.nodes

    def most_at_once(steps):
        last = {a: k for k, step in enumerate(steps) for a in nodes[step].args}
        ends = np.zeros(len(steps) + 1, int)
        for k, step in enumerate(steps):
            if step in last:
                ends[k] += 1
                ends[last[step]] -= 1
        return ends.cumsum().max()

    given = [k for k, node in enumerate(nodes) if node.args and node.op not in ("sin", "cos")]
    chosen = [s for part in llvm_ir.schedule(graph).parts for s in part if s >= 0]
    assert sorted(chosen) == given
    assert most_at_once(chosen) < most_at_once(given) / 2


def test_divisions_by_the_same_number_share_one_reciprocal_and_a_single_one_stays_exact():
    x = casadi.SX.sym("x", 4)
    function = casadi.Function("shares", [x], [casadi.vertcat(x[0] / x[3], x[1] / x[3], x[0] / x[2])])
    code = compiled("shares", ("test",), lambda: function)
    assert [node.op for node in code.graph.nodes].count("div") == 1
    assert [node.op for node in code.graph.nodes].count("inv") == 1
    values = np.random.default_rng(4).normal(size=(200, 4))
    answers = code(values)
    np.testing.assert_array_equal(answers[:, 2], values[:, 0] / values[:, 2])
    np.testing.assert_allclose(answers[:, :2], values[:, :2] / values[:, 3:], rtol=4.5e-16)


def test_products_and_sums_written_either_way_round_are_one():
    x = casadi.SX.sym("x", 2)
    function = casadi.Function("twins", [x], [casadi.vertcat(x[0] * x[1] - x[1] * x[0], x[0] + x[1], x[1] + x[0])])
    graph = compiled("twins", ("test",), lambda: function).graph
    assert [node.op for node in graph.nodes].count("mul") <= 1
    assert [node.op for node in graph.nodes].count("add") == 1


def test_the_native_loop_of_single_calls_visits_every_row_and_agrees_with_pinocchio_and_hand_written_c():
    from bellcrank_bench.measurements.single_calls import forward_dynamics_calls

    rows = forward_dynamics_calls("planar_2r", repeats=1)
    assert [r.method for r in rows[:2]] == ["forward_dynamics"] * 2
    assert len(rows) == 4 or "no C compiler" in rows[2].note
    assert all(r.error < 1e-12 and 0 < r.nanoseconds < 1e7 for r in rows if "no C compiler" not in r.note)


# ---- the cache


def torque():
    robot = bc.load_robot("planar_2r", friction="none")
    return robot.inverse_dynamics(np.ones((20, 2)), np.ones((20, 2)), np.ones((20, 2)))


@pytest.mark.tier2
def test_a_second_process_loads_neither_pinocchio_nor_casadi(fresh_cache):
    script = (
        "import sys, numpy, bellcrank\n"
        "r = bellcrank.load_robot('ur5')\n"
        "r.inverse_dynamics(numpy.zeros((20, 6)), numpy.zeros((20, 6)), numpy.zeros((20, 6)))\n"
        "print(sorted({'pinocchio', 'casadi', 'yourdfpy', 'bellcrank._trace'} & set(sys.modules)))\n"
    )
    outputs = [
        subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert "pinocchio" in outputs[0] and outputs[1].strip() == "[]"


def test_the_cache_folder_is_the_users_alone(fresh_cache):
    torque()
    assert stat.S_IMODE(fresh_cache.stat().st_mode) == 0o700
    assert any(p.name.startswith("object-") for p in fresh_cache.iterdir())


def entries(folder):
    return [p for p in folder.iterdir() if "-" in p.name]


@pytest.mark.parametrize("damage", ["truncate", "flip", "empty", "garbage", "directory"])
def test_damaged_entries_are_made_anew(fresh_cache, damage):
    expected = torque()
    for path in entries(fresh_cache):
        data = bytearray(path.read_bytes())
        if damage == "truncate":
            path.write_bytes(data[: len(data) // 2])
        elif damage == "flip":
            data[-10] ^= 0xFF
            path.write_bytes(data)
        elif damage == "empty":
            path.write_bytes(b"")
        elif damage == "garbage":
            path.write_bytes(os.urandom(3000))
        else:
            path.unlink()
            path.mkdir()
    np.testing.assert_array_equal(torque(), expected)


def test_well_signed_nonsense_is_made_anew(fresh_cache):
    expected = torque()
    for path in entries(fresh_cache):
        cache.store(path.name, b"\x7fELF but not really")
    np.testing.assert_array_equal(torque(), expected)
    for path in entries(fresh_cache):
        if not path.name.startswith("object-"):
            cache.store(path.name, b'{"inputs": "many", "outputs": [2], "objects": []}')
    np.testing.assert_array_equal(torque(), expected)


def test_code_for_another_processor_is_not_used(fresh_cache, monkeypatch):
    ir = "define i32 @evaluate() {\n  ret i32 0\n}\n"
    keys = set()
    for name in TARGETS:
        monkeypatch.setenv("BELLCRANK_TARGET", name)
        keys.add(machine.object_key(ir, machine.target()))
    assert len(keys) == len(TARGETS)


def test_an_unusable_cache_folder_is_done_without(tmp_path, monkeypatch):
    file = tmp_path / "file"
    file.write_text("in the way")
    for value in (str(file), str(file / "below")):
        monkeypatch.setenv("BELLCRANK_CACHE", value)
        with pytest.warns(UserWarning, match="not used as a cache"):
            assert cache.folder() is None
        torque()
    monkeypatch.setenv("BELLCRANK_CACHE", "off")
    assert cache.folder() is None
    torque()


@pytest.mark.tier2
def test_threads_that_call_first_at_once_all_get_the_answer(fresh_cache):
    script = (
        "import threading, numpy, bellcrank\n"
        "robot, q = bellcrank.load_robot('ur5'), numpy.random.default_rng(0).normal(size=(500, 6))\n"
        "barrier, answers = threading.Barrier(8), []\n"
        "def work():\n"
        "    barrier.wait()\n"
        "    answers.append((robot.inverse_dynamics(q, q, q), robot.inverse_dynamics(q[0], q[0], q[0])))\n"
        "threads = [threading.Thread(target=work) for _ in range(8)]\n"
        "[t.start() for t in threads], [t.join() for t in threads]\n"
        "print(len(answers), all(numpy.array_equal(answers[0][k], a[k]) for a in answers for k in (0, 1)))\n"
    )
    for _ in range(2):  # with an empty cache, then with a full one
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout) == (0, "8 True\n"), done.stderr


def test_code_is_loaded_beside_an_array_of_3_gb_with_gaps_of_a_page_above_it():
    """Code reaches its constants within 2 GB: parts that were placed one by one could be further apart."""
    script = """
        import mmap
        import casadi
        import numpy as np
        from bellcrank.codegen.compile import compiled

        def reserved(size):
            return mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS, prot=0)

        pages = [reserved(mmap.PAGESIZE) for _ in range(4000)]
        array = reserved(3 << 30)
        del pages[::2]
        x = casadi.SX.sym("x", 20)
        terms = [casadi.sin(x[k] * (k + 1.37)) * 3.14 + casadi.exp(x[k]) * x[k - 1] for k in range(20)]
        function = casadi.Function("gaps", [x], [casadi.vertcat(*terms)])
        at = np.random.default_rng(0).normal(size=(9, 20))
        found, expected = compiled("gaps", ("test",), lambda: function)(at), function(at.T).full().T
        np.testing.assert_allclose(found, expected, rtol=1e-12)
        """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_code_of_the_same_name_can_be_loaded_again():
    ir = "define i32 @evaluate(i32 %x) {\n  %y = add i32 %x, 1\n  ret i32 %y\n}\n"
    code = machine.object_code(ir, machine.target())
    loaded = [machine.Loaded("same", code, machine.target()) for _ in range(3)]
    assert len({library.address for library in loaded}) == 3


def test_a_changed_source_anywhere_in_the_package_makes_recipes_stale(tmp_path, monkeypatch):
    """Expressions are built in several modules; code cached from an older version of any must not be used."""
    import shutil

    from bellcrank.codegen import compile as module

    original = module.Path(module.__file__).parent.parent
    copy = tmp_path / "bellcrank"
    shutil.copytree(original, copy, ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    monkeypatch.setattr(module, "__file__", str(copy / "codegen" / "compile.py"))
    monkeypatch.setattr(module, "_SETTLED", -1.0)  # the digest is kept in the cache at once
    digests = [module.sources.__wrapped__()]
    assert module.sources.__wrapped__() == digests[0]
    for changed in ("motion/kinematics/pose_equations.py", "robot/dynamics/equations.py", "codegen/kernels.py"):
        with (copy / changed).open("a") as file:
            file.write("# changed\n")
        digests.append(module.sources.__wrapped__())
    assert len(set(digests)) == 4
