"""Products contracted into sums, and the same results at each of LLVM's optimisation levels."""

import itertools
from dataclasses import replace
from fractions import Fraction

import casadi
import numpy as np
import pytest

from bellcrank._step import evaluate
from bellcrank.codegen import kernels, llvm_ir
from bellcrank.codegen import llvm as machine
from bellcrank.codegen.compile import compiled
from bellcrank.codegen.expression_graph import Graph, contracted, graph_of


def graph(make, size):
    x = casadi.SX.sym("x", size)
    return graph_of(
        casadi.Function("f", [x], [casadi.vertcat(*make(*casadi.vertsplit(x)))]).serialize().encode("latin-1")
    )


def operations(g: Graph):
    return sorted(node.op for node in g.nodes if node.args)


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda a, b, c: [a * b + c], ["fma"]),
        (lambda a, b, c: [c + a * b], ["fma"]),
        (lambda a, b, c: [a * b - c], ["fms"]),
        (lambda a, b, c: [c - a * b], ["fnma"]),
        (lambda a, b, c: [a * a + c], ["fma"]),
        (lambda a, b, c: [a * b + b * c], ["fma", "mul"]),
        (lambda a, b, c: [a * b + c, a * b], ["add", "mul"]),  # the product is a result as well
        (lambda a, b, c: [a * b + c, a * b + 1], ["add", "add", "mul"]),
        (lambda a, b, c: [a * b * c], ["mul", "mul"]),
    ],
)
def test_a_product_that_one_sum_reads_is_contracted_into_it(make, expected):
    assert operations(contracted(graph(make, 3))) == expected


@pytest.mark.skipif(not machine.target().fused, reason="this processor has no fused multiply-add")
@pytest.mark.parametrize(
    ("make", "exact"),
    [
        (lambda a, b, c: [a * b + c], lambda a, b, c: a * b + c),
        (lambda a, b, c: [a * b - c], lambda a, b, c: a * b - c),
        (lambda a, b, c: [c - a * b], lambda a, b, c: c - a * b),
    ],
)
def test_a_contracted_sum_is_rounded_once(make, exact):
    x = casadi.SX.sym("x", 3)
    code = compiled("fused", ("test", str(exact(2, 3, 5))), lambda: casadi.Function(
        "f", [x], [casadi.vertcat(*make(*casadi.vertsplit(x)))]))  # fmt: skip
    for values in np.random.default_rng(0).normal(size=(50, 3)):
        assert code(values)[0] == float(exact(*map(Fraction, values.tolist())))


def mixed(seed):
    """Sums, products, quotients, sines and comparisons of values near and far, some of them huge or not finite."""
    random = np.random.default_rng(seed)
    x = casadi.SX.sym("x", 6)
    values = [*casadi.vertsplit(x), casadi.SX(0.75)]
    for _ in range(500):
        near, mid, far = (values[-int(random.integers(1, min(len(values), n) + 1))] for n in (4, 40, 400))
        made = [
            near * mid + far, near * mid - far, far - near * mid, near * near + mid * far, (near - far) / 2,
            near / (1 + mid * mid), casadi.sin(near + far), casadi.cos(mid), casadi.fmin(near, far),
            casadi.if_else(near < mid, far, -near), casadi.sqrt(mid * mid + 1), -near * mid, casadi.exp(-mid * mid),
        ]  # fmt: skip
        values.append(made[random.integers(len(made))])
    picked = [values[i] for i in random.integers(0, len(values), 40)]
    return graph_of(casadi.Function("mixed", [x], [casadi.vertcat(*picked), values[-1]]).serialize().encode("latin-1"))


@pytest.mark.tier2
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", ["scalar", "lanes", "batch"])
def test_each_level_and_division_gives_the_same_bits(kind, seed, monkeypatch):
    chosen, g = machine.target(), mixed(seed)
    x = np.random.default_rng(seed).normal(size=(24, 6)) * 10.0 ** np.random.default_rng(seed + 9).integers(
        -2, 3, (24, 6)
    )
    x[3, 2], x[7, 1], x[11, 0] = 1e7, np.inf, np.nan
    found = []
    for level, (part, whole) in itertools.product((0, 1, 2), ((10**9, 10**9), (30, 10**9), (30, 0))):
        monkeypatch.setattr(llvm_ir, "PART", part)
        monkeypatch.setattr(llvm_ir, "WHOLE", whole)
        monkeypatch.setattr(llvm_ir, "LONG", 0)
        ir = kernels.KINDS[kind](g, chosen.lanes, chosen.fused)
        assert ("@part5" in ir) == (part == 30) and (" alwaysinline " in ir) == (part == 30 and whole > 0)
        code = machine.Loaded("levels", machine.object_code(ir, chosen, level), chosen)
        found.append(outputs(code, kind, chosen.lanes, x))
    for other in found[1:]:
        np.testing.assert_array_equal(other, found[0])


def outputs(code, kind, lanes, x):
    """The outputs of the code for the rows of x."""
    if kind == "scalar":
        return np.vstack([np.concatenate(evaluate(code.address, (row,), (6,), (40, 1))) for row in x])
    import ctypes

    if kind == "batch":
        out = [np.empty((len(x), 40)), np.empty((len(x), 1))]
        call = ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.c_void_p] * 3, ctypes.c_int64)(code.address)
        ins, outs = (ctypes.c_void_p * 1)(x.ctypes.data), (ctypes.c_void_p * 2)(*[o.ctypes.data for o in out])
        assert call(ins, outs, (ctypes.c_int64 * 1)(6), len(x)) == 0
        return np.hstack(out)
    call = ctypes.CFUNCTYPE(ctypes.c_int32, *[ctypes.c_void_p] * 2)(code.address)
    rows = []
    for first in range(0, len(x), lanes):
        inside, outside = aligned(6 * lanes), aligned(41 * lanes)
        inside.reshape(6, lanes)[:] = x[first : first + lanes].T
        ins = (ctypes.c_void_p * 1)(inside.ctypes.data)
        outs = (ctypes.c_void_p * 2)(outside.ctypes.data, outside.ctypes.data + 40 * lanes * 8)
        assert call(ins, outs) == 0
        rows.append(outside.reshape(41, lanes).T.copy())
    return np.vstack(rows)


def aligned(size):
    memory = np.empty(size + 8)
    first = -(memory.ctypes.data // 8) % 8
    return memory[first : first + size]


def test_contraction_keeps_the_graph_s_sizes_and_kind():
    g = replace(mixed(0), seldom=True)
    made = contracted(g)
    assert made.seldom and made.input_sizes == g.input_sizes and [n for n, *_ in made.outputs] == [40, 1]
    assert len(made.op) < len(g.op)
