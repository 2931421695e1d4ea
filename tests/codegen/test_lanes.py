"""Kernels of the kinds "lanes" and "batch": each lane is computed as if it were alone."""

import ctypes

import casadi
import numpy as np
import pytest

import bellcrank as bc
from bellcrank.codegen import llvm as machine
from bellcrank.codegen import llvm_ir
from bellcrank.codegen.compile import compiled
from bellcrank.dynamics.equations.system import system_of, system_parameters

TARGETS = ["native", "avx2", "baseline"]
_LANES = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p)


def aligned(rows, width):
    """A zeroed array (rows, width) that begins at a multiple of 64 bytes."""
    memory = np.zeros(rows * width + 8)
    skipped = (-memory.ctypes.data // 8) % 8
    return memory[skipped : skipped + rows * width].reshape(rows, width)


def evaluate_lanes(code, *samples):
    """The kernel "lanes" on samples (W, size) an input; each output (W, size)."""
    width = machine.target().lanes
    call = _LANES(code.address("lanes"))
    inputs = [aligned(size, width) for size in code.input_sizes]
    outputs = [aligned(size, width) for size in code.output_sizes]
    for array, value in zip(inputs, samples, strict=True):
        array[:] = value.T
    ins = (ctypes.c_void_p * len(inputs))(*[a.ctypes.data for a in inputs])
    outs = (ctypes.c_void_p * len(outputs))(*[a.ctypes.data for a in outputs])
    assert call(ins, outs) == 0
    return [a.T.copy() for a in outputs]


def mixed():
    x = casadi.SX.sym("x", 3)
    angles = [x[0], x[1] + x[2], 3 * x[2], x[0] * x[1]]
    terms = [f(a) for f in (casadi.sin, casadi.cos, casadi.tanh) for a in angles]
    return casadi.Function("mixed", [x], [casadi.vertcat(*terms), casadi.vertcat(x[0] / x[1], casadi.sqrt(x[2]), 0)])


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("pieces", [False, True])
def test_lanes_and_batches_agree_with_the_scalar_kernel(target, pieces, monkeypatch):
    monkeypatch.setenv("BELLCRANK_TARGET", target)
    if pieces:
        for name in ("WHOLE", "PART"):
            monkeypatch.setattr(llvm_ir, name, 6)
    code = compiled("mixed", ("lanes", target, str(pieces)), mixed)
    width = machine.target().lanes
    x = np.random.default_rng(3).uniform(0.1, 9.0, (width, 3))
    found = evaluate_lanes(code, x)
    for lanes, batch, one in zip(found, code(x), zip(*[code(row) for row in x], strict=True), strict=True):
        np.testing.assert_allclose(lanes, np.array(one), rtol=4e-16, atol=4e-16)
        np.testing.assert_array_equal(lanes, batch)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("other", [1.1e5, -3e9, np.inf, np.nan])
def test_an_angle_beyond_the_fast_sine_does_not_change_the_other_lanes(target, other, monkeypatch):
    monkeypatch.setenv("BELLCRANK_TARGET", target)
    code = compiled("mixed", ("lanes", target, "one large"), mixed)
    width = machine.target().lanes
    random = np.random.default_rng(5)
    for lane in range(width):
        x = random.uniform(0.1, 900.0, (width, 3))
        disturbed = x.copy()
        disturbed[lane, 0] = other
        others = np.arange(width) != lane
        for plain, now in zip(evaluate_lanes(code, x), evaluate_lanes(code, disturbed), strict=True):
            np.testing.assert_array_equal(now[others], plain[others])
        for plain, now in zip(code(x), code(disturbed), strict=True):
            np.testing.assert_array_equal(now[others], plain[others])
        exact = np.sin(other) if np.isfinite(other) else np.nan
        np.testing.assert_array_equal(evaluate_lanes(code, disturbed)[0][lane, 0], exact)


@pytest.mark.parametrize("name", ["four_bar", "rolling_disk", "spring_pendulum", "five_bar"])
def test_a_scenes_stage_in_lanes_agrees_with_that_for_one_state(name):
    scene = bc.load_scene(name)
    system, width = system_of(scene), machine.target().lanes
    random = np.random.default_rng(1)
    sizes = system.stage.input_sizes
    samples = [random.uniform(0.2, 0.9, (width, size)) for size in sizes]
    samples[3] = np.tile(system_parameters(scene), (width, 1))
    found = evaluate_lanes(system.stage, *samples)
    for lane in range(width):
        one = system.stage(*[s[lane] for s in samples])
        for lanes, single in zip(found, one if isinstance(one, tuple) else (one,), strict=True):
            np.testing.assert_allclose(lanes[lane], single, rtol=1e-11, atol=1e-12)
