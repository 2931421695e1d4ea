"""Graphs that repeat themselves, written as loops: the same bits as straight code, and code that does not grow."""

import casadi
import numpy as np
import pytest

import bellcrank as bc
from bellcrank.codegen import kernels, llvm_ir
from bellcrank.codegen import llvm as machine
from bellcrank.codegen.compile import compiled
from bellcrank.codegen.expression_graph import graph_of
from bellcrank.dynamics.equations.system import system_of
from bellcrank_bench.problems.chains_and_arms import chain_scene
from bellcrank_bench.problems.n_four_bar import n_four_bar

pytestmark = pytest.mark.tier2

TARGETS = ["baseline", "avx2", "avx512"]


def available(target):
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("BELLCRANK_TARGET", target)
            return bool(machine.target())
    except bc.BellcrankError:
        return False


def recursion(seed, bodies=30):
    """A random recursion out and back over bodies, with constants of each, as casadi's function of (x, p).

    Some values are read one or two bodies later, some by all; the ends differ; outputs are in several orders.
    """
    random = np.random.default_rng(seed)
    x, p = casadi.SX.sym("x", 2 * bodies + 3), casadi.SX.sym("p", 4)
    program = [(int(random.integers(8)), *random.integers(0, 40, 3).tolist()) for _ in range(40)]
    operations = [
        lambda a, b, c, k: a * b + c, lambda a, b, c, k: a - b * k, lambda a, b, c, k: a / (1.5 + b * b),
        lambda a, b, c, k: casadi.cos(a), lambda a, b, c, k: casadi.fmin(a, b), lambda a, b, c, k: 0.25 * a + b,
        lambda a, b, c, k: casadi.sqrt(1 + a * a), lambda a, b, c, k: casadi.tanh(a),
    ]  # fmt: skip

    def body(read, constants):
        values = list(read)
        for kind, i, j, k in program:
            a, b, c = (values[-1 - n % len(values)] for n in (i, j, k))
            values.append(operations[kind](a, b, c, constants[k % 3]))
        return values

    def row(k, *read):
        own = [x[k], x[bodies + k], x[2 * bodies + k % 3], p[1], casadi.sin(x[k]), casadi.sin(x[k] + x[bodies + k])]
        return body([*read, *own], [1.25, float(random.uniform(0.5, 2)), 0.5 if k % 4 else 0.75])

    out = [[casadi.SX(0.5), p[0]]]
    for k in range(bodies):
        out.append([v / 3 for v in row(k, out[-1][-1], out[-1][-2], out[max(k - 2, 0)][0], p[2])[-4:]])
    back = [out[-1][-1]]
    for k in reversed(range(bodies)):
        back.append(row(k, back[-1], out[k + 1][-1], out[k + 1][-3], out[k][-2])[-1] / 4)
    results = [
        casadi.vertcat(*back),
        casadi.vertcat(*[values[-1] for values in out[::-1]], 0, 2.5, x[3]),
        casadi.vertcat(x[:bodies], *[values[-2] for values in out[3::2]]),
        back[-1],
    ]
    return casadi.Function("recursion", [x, p], results)


@pytest.fixture
def straight_and_rolled(monkeypatch):
    def both(name, function):
        made = []
        for least in (10**9, 0):
            monkeypatch.setattr(llvm_ir, "ROLLED", least)
            code = compiled(name, ("rolled", str(least)), lambda: function)
            for kind in ("scalar", "batch", "lanes"):
                code.address(kind)
            assert ("@part" in code.ir("scalar") and "%i = phi i64" in code.ir("scalar")) == (least == 0)
            made.append(code)
        return made

    return both


@pytest.mark.parametrize("target", [t for t in TARGETS if available(t)])
@pytest.mark.parametrize("seed", range(4))
def test_loops_give_the_same_bits_as_straight_code(seed, target, monkeypatch, straight_and_rolled):
    monkeypatch.setenv("BELLCRANK_TARGET", target)
    function = recursion(seed)
    straight, rolled = straight_and_rolled(f"recursion {seed}", function)
    random = np.random.default_rng(seed)
    x, p = random.normal(size=(19, 63)), random.normal(size=(19, 4))
    x[3, 7], x[11, 40], x[5, 20] = 1e7, -3e8, np.nan  # sines by the C library
    for exact, found, expected in zip(straight(x, p), rolled(x, p), function(x.T, p.T), strict=True):
        np.testing.assert_array_equal(found, exact)
        fine = np.arange(19) != 5
        np.testing.assert_allclose(found[fine], np.array(expected).T[fine], rtol=1e-9, atol=1e-9)
    for row in range(19):
        for exact, found in zip(straight(x[row], p[row]), rolled(x[row], p[row]), strict=True):
            np.testing.assert_array_equal(found, exact)


@pytest.mark.parametrize("seed", range(4))
def test_unoptimised_loops_give_the_same_bits(seed, monkeypatch):
    from bellcrank._step import evaluate

    monkeypatch.setattr(llvm_ir, "ROLLED", 0)
    graph = graph_of(recursion(seed).serialize().encode("latin-1"))
    chosen = machine.target()
    ir = kernels.KINDS["scalar"](graph, chosen.lanes, chosen.fused)
    sizes = tuple(size for size, *_ in graph.outputs)
    random = np.random.default_rng(seed)
    inputs = (random.normal(size=63), random.normal(size=4))
    answers = []
    for level in (0, 1, 2):
        loaded = machine.Loaded("rolled", machine.object_code(ir, chosen, level), chosen)
        answers.append(np.concatenate(evaluate(loaded.address, inputs, graph.input_sizes, sizes)))
    np.testing.assert_array_equal(answers[0], answers[2])
    np.testing.assert_array_equal(answers[1], answers[2])


@pytest.mark.parametrize(("mechanism", "growth"), [(chain_scene, 1.02), (n_four_bar, 1.3)])
@pytest.mark.parametrize("kind", ["scalar", "lanes"])
def test_the_code_of_a_long_mechanism_hardly_grows_with_it(mechanism, growth, kind):
    """The order in which many loops are eliminated has ends of its own wherever it turns, hence the larger bound."""
    lines = [len(system_of(mechanism(count)).rhs.ir(kind).splitlines()) for count in (60, 120)]
    assert lines[1] < growth * lines[0]
