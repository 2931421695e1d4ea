"""Work grows with the mechanism: what is traced, compiled and kept in memory is proportional to its links."""

import subprocess
import sys

import casadi
import numpy as np
import pytest

import bellcrank as bc
from bellcrank.codegen import llvm as machine
from bellcrank.codegen import llvm_ir
from bellcrank.codegen.compile import compiled, make_ready
from bellcrank.dynamics.equations.kkt import elimination_order
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.dynamics.postures.consistent_start import displaced
from bellcrank.elements.symbols import Symbols
from bellcrank.robot.model.joints import random_posture
from bellcrank.scene.scene import load_scene
from bellcrank_bench.problems.n_four_bar import n_four_bar
from bellcrank_bench.problems.urdf_texts import chain

MEGABYTE = 2**20


def affine(counts):
    """Whether counts at n, 2n and 4n lie on a line, within 5 %."""
    first, second, third = counts
    return third - second == pytest.approx(2 * (second - first), rel=0.05)


# ---- tracing


@pytest.mark.parametrize("algorithm", ["inverse_dynamics", "forward_dynamics", "energy", "configuration_rate"])
def test_traced_algorithms_grow_with_the_number_of_links(algorithm, tmp_path):
    operations, sizes = [], []
    for links in (12, 24, 48):
        path = tmp_path / f"chain_{links}.urdf"
        path.write_text(chain(links))
        function = bc.load_robot(path).equations.algorithm(algorithm)
        text = function.serialize()
        operations.append(function.n_instructions())
        sizes.append(len(text))
    assert affine(operations) and affine(sizes)


def test_a_mass_matrix_of_many_joints_grows_with_their_number_and_is_the_whole_one(tmp_path, monkeypatch):
    operations = []
    for links in (12, 24, 48):
        path = tmp_path / f"chain_{links}.urdf"
        path.write_text(chain(links))
        robot = bc.load_robot(path, rotor_inertia={"joint_3": 0.02} if links == 12 else None)
        operations.append(robot.equations.inertial_torque().n_instructions())
        if links == 12:
            rng = np.random.default_rng(4)
            postures = rng.uniform(-1.0, 1.0, (3, 12))
            whole = robot.mass_matrix(postures)
            monkeypatch.setattr("bellcrank.robot.robot.LARGEST_WHOLE", 4)
            columns = robot.mass_matrix(postures)
            assert columns.shape == whole.shape == (3, 12, 12)
            assert np.abs(columns - whole).max() < 1e-14 * np.abs(whole).max()
            assert np.array_equal(columns, columns.transpose(0, 2, 1))
            assert robot.mass_matrix(postures[1]) == pytest.approx(whole[1], rel=1e-12)
            v, a = rng.uniform(-1.0, 1.0, (2, 12))
            forces = robot.inverse_dynamics(postures[0], v, a) - robot.inverse_dynamics(postures[0], v, 0.0 * a)
            assert columns[0] @ a == pytest.approx(forces, rel=1e-9)  # dτ/da = M
    assert affine(operations)


@pytest.mark.tier2
def test_a_chain_of_300_links_is_traced_within_a_gigabyte(tmp_path):
    """One array of n x n x n symbols would take several. VmHWM, as ru_maxrss begins with that of the tests' process."""
    path = tmp_path / "chain.urdf"
    path.write_text(chain(300))
    script = (
        "import resource\n"
        f"resource.setrlimit(resource.RLIMIT_AS, ({1500 * MEGABYTE}, {1500 * MEGABYTE}))\n"
        "import bellcrank\n"
        f"equations = bellcrank.load_robot({str(path)!r}).equations\n"
        "for name in ('inverse_dynamics', 'forward_dynamics', 'energy'):\n"
        "    print(equations.algorithm(name).n_instructions())\n"
        "print(next(line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM')))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    *operations, kilobytes = map(int, done.stdout.split())
    assert all(100 * 300 > n > 20 * 300 for n in operations[1:]) and kilobytes < 1024**2


def test_an_algorithm_is_traced_once_for_all_who_ask():
    s = Symbols(load_scene("rolling_disk").robot)
    assert s.algorithm("energy") is s.algorithm("energy")


# ---- constraints


@pytest.mark.tier2
def test_equations_of_a_row_of_loops_grow_with_the_number_of_loops():
    counts = {"rhs": [], "fallback": [], "project": [], "entries": []}
    for loops in (4, 8, 16):
        system = system_of(n_four_bar(loops))
        for name in ("rhs", "fallback", "project"):
            counts[name].append(getattr(system, name).graph.operations)
        counts["entries"].append(sum(system.linearised.output_sizes))
    assert all(affine(each) for each in counts.values()), counts
    assert counts["entries"][-1] < 13 * 16  # φ, φ̇ and the few entries of J of each loop, not 2 N (2 N + 1)


@pytest.mark.tier2
@pytest.mark.parametrize("case", ["n_four_bar", "bricard", "rolling_disk", "five_bar"])
def test_the_sparse_jacobian_of_constraints_is_that_of_finite_differences(case):
    scene = n_four_bar(5) if case == "n_four_bar" else load_scene(case)
    system, random, h = system_of(scene), np.random.default_rng(3), 1e-6
    t, u, p = np.zeros(1), scene.signals_at(np.zeros(1))[0], system_parameters(scene)

    def at(q, v):
        return system.linearised_constraints(t, np.concatenate([q, v, np.zeros(system.size - len(q) - len(v))]), u, p)

    for _ in range(3):
        q, v = random_posture(scene.robot, random), random.normal(size=system.nv)
        gap, speed, jacobian = at(q, v)
        assert jacobian.shape == (len(speed), system.nv)
        steps = [at(q, v + h * e)[1] - at(q, v - h * e)[1] for e in np.eye(system.nv)]
        np.testing.assert_allclose(jacobian, np.array(steps).T / (2 * h), atol=1e-8)
        slopes = [
            at(displaced(scene, q, h * e), v)[0] - at(displaced(scene, q, -h * e), v)[0] for e in np.eye(system.nv)
        ]
        np.testing.assert_allclose(jacobian[: len(gap)], np.array(slopes).T / (2 * h), atol=1e-8)
        x = np.concatenate([q, v, np.zeros(system.size - len(q) - len(v))])
        metric = system.constraint_metric(t, x, u, p)
        np.testing.assert_allclose(metric[0], jacobian, atol=1e-14)
        np.testing.assert_allclose(metric[1], scene.robot.mass_matrix(q), atol=1e-12)
    many = system.linearised_constraints(t, np.stack([x, 0.5 * x]), u, p)[2]
    np.testing.assert_allclose(many[0], jacobian, atol=1e-14)


def by_trial(mass, jacobian):
    """The same order by looking at every coordinate and constraint that is left, each time."""
    n, m = mass.shape[0], jacobian.shape[0]
    near = [set() for _ in range(n + m)]
    for i, j in zip(*np.nonzero(mass), strict=True):
        near[i] |= {int(j)} - {i}
    for i, j in zip(*np.nonzero(jacobian), strict=True):
        near[n + i].add(int(j))
        near[j].add(n + int(i))
    left, order = set(range(n + m)), []
    while left:
        free = [k for k in left if k < n or not (set(np.flatnonzero(jacobian[k - n])) & left)]
        k = min(free, key=lambda k: (len(near[k]), k))
        order.append(k)
        left.discard(k)
        for a in near[k]:
            near[a] = (near[a] | near[k]) - {a, k}
    return order


def test_the_order_of_elimination_is_that_of_least_degree_with_constraints_after_their_coordinates():
    random = np.random.default_rng(0)
    for _ in range(60):
        n = int(random.integers(1, 15))
        mass, jacobian = (random.random((k, n)) < random.random() / 2 for k in (n, random.integers(0, n + 1)))
        mass = mass | mass.T | np.eye(n, dtype=bool)
        assert elimination_order(mass, jacobian) == by_trial(mass, jacobian)


# ---- compiling


def sums(seed=0):
    """Products of 60 numbers in all pairs, summed in another order: most wait for long."""
    x = casadi.SX.sym("x", 60)
    products = [x[i] * x[j] for i in range(60) for j in range(i)]
    order = np.random.default_rng(seed).permutation(len(products))
    columns = [sum(products[k] * casadi.sin(x[int(k) % 60]) for k in order[r::20]) for r in range(20)]
    return casadi.Function("sums", [x], [casadi.vertcat(*columns)])


@pytest.mark.tier2
@pytest.mark.parametrize(
    ("waiting", "seldom", "joined"), [(10**9, False, True), (50, False, False), (10**9, True, False)]
)
def test_long_code_is_joined_unless_many_values_wait_or_it_is_called_seldom(waiting, seldom, joined, monkeypatch):
    monkeypatch.setattr(llvm_ir, "WAITING", waiting)
    monkeypatch.setattr(llvm_ir, "WHOLE", 10**9)
    monkeypatch.setattr(llvm_ir, "ROLLED", 10**9)
    code = compiled("sums", ("test", str(waiting), str(seldom)), sums, seldom)
    plan = llvm_ir.schedule(code.graph)
    assert len(plan.parts) >= 8 and plan.joined == joined
    assert (" alwaysinline " in code.ir("scalar")) == joined
    x = np.random.default_rng(1).normal(size=(9, 60))
    np.testing.assert_allclose(code(x), np.array(sums()(x.T)).T, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(code(x[4]), np.array(sums()(x[4])).ravel(), rtol=1e-12, atol=1e-12)


def test_functions_made_ready_together_are_compiled_once_each_and_kept(fresh_cache, monkeypatch):
    made = []
    compile_ir = machine.object_code
    monkeypatch.setattr(machine, "object_code", lambda ir, *how: made.append(ir) or compile_ir(ir, *how))

    def functions():
        x = casadi.SX.sym("x", 2)
        return [
            compiled(f"power {k}", ("test",), lambda k=k: casadi.Function("power", [x], [x[0] ** k * casadi.cos(x[1])]))
            for k in (2, 3, 4)
        ]

    wanted = [(function, kind) for function in functions() for kind in ("scalar", "batch")]
    addresses = make_ready(wanted)
    assert make_ready(wanted) == addresses == [function.address(kind) for function, kind in wanted]
    assert len(made) == 6
    x = np.array([1.5, 0.3])
    for k, function in zip((2, 3, 4), functions(), strict=True):  # as another process finds them
        make_ready([(function, "scalar"), (function, "batch")])
        assert function(x)[0] == pytest.approx(1.5**k * np.cos(0.3), rel=1e-15)
        np.testing.assert_allclose(function(np.tile(x, (9, 1)))[:, 0], 1.5**k * np.cos(0.3), rtol=1e-15)
    assert len(made) == 6
