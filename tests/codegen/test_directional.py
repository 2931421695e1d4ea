"""Directional derivatives in two functions: at a point for one sample, along directions in SIMD lanes."""

import ctypes

import casadi
import numpy as np
import pytest

from bellcrank.codegen import llvm as machine
from bellcrank.codegen.directional import directional

DERIVATIVE = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p)


def aligned(shape):
    """Zeros whose memory begins at a multiple of 64 bytes."""
    size = int(np.prod(shape))
    whole = np.zeros(size + 8)
    first = (-whole.ctypes.data // 8) % 8
    return whole[first : first + size].reshape(shape)


def along(derivative, tape, *directions):
    """The derivative along as many directions as there are lanes, each (entries, lanes)."""
    inputs = [np.ascontiguousarray(tape)]
    for one in directions:
        inputs.append(aligned(one.shape))
        inputs[-1][:] = one
    output = aligned((derivative.along.output_sizes[0], machine.target().lanes))
    pointers = (ctypes.c_void_p * len(inputs))(*[x.ctypes.data for x in inputs])
    results = (ctypes.c_void_p * 1)(output.ctypes.data)
    assert DERIVATIVE(derivative.along.address("directions"))(pointers, results) == 0
    return output


def example():
    x, p, dx, dp = (casadi.SX.sym(name, n) for name, n in (("x", 3), ("p", 2), ("dx", 3), ("dp", 2)))
    value = casadi.vertcat(
        casadi.sin(x[0] * p[0]) / (1.0 + x[1] * x[1]),
        casadi.fmax(x[2], p[1]) * casadi.exp(-x[0]) / (2.0 + casadi.cos(x[2])),
        7.0 * x[1] / p[0],
        casadi.SX(3.0),
    )
    change = casadi.jtimes(value, casadi.vertcat(x, p), casadi.vertcat(dx, dp))
    return casadi.Function("example", [x, p, dx, dp], [casadi.densify(value), casadi.densify(change)])


@pytest.mark.parametrize("target", ["native", "avx2", "baseline"])
def test_both_functions_together_are_the_derivative(target, monkeypatch):
    monkeypatch.setenv("BELLCRANK_TARGET", target)
    derivative, whole = directional("example", ["test"], example, 2), example()
    random = np.random.default_rng(1)
    x, p, lanes = random.normal(size=3), 1.0 + random.random(2), machine.target().lanes
    dx, dp = random.normal(size=(3, lanes)), random.normal(size=(2, lanes))
    value, tape = derivative.point(x, p)
    found = along(derivative, tape, dx, dp)
    for lane in range(lanes):
        expected = whole(x, p, dx[:, lane], dp[:, lane])
        assert value == pytest.approx(np.asarray(expected[0])[:, 0], rel=1e-14)
        assert found[:, lane] == pytest.approx(np.asarray(expected[1])[:, 0], rel=1e-13, abs=1e-15)


def test_what_carries_no_direction_is_computed_at_the_point():
    derivative = directional("example", ["test"], example, 2)
    operations = {node.op for node in derivative.along.graph.nodes}
    assert operations <= {"const", "input", "add", "sub", "mul", "neg", "twice"}
    assert derivative.along.input_sizes[0] == derivative.point.output_sizes[-1]
