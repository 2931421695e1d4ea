"""What computing costs in a page, next to the machine code of the same expressions: Chromium's WebAssembly, headless.

All times are of one thread. A page's clock is that of its functions alone: without drawing, messages and text.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.codegen.compile import Compiled, compiled
from bellcrank.codegen.webassembly import webassembly
from bellcrank.files.temporaries import temporary_folder
from bellcrank.replays.page.rendering import find_browser, find_playwright, open_page
from bellcrank.replays.replay import replay
from bellcrank.robot.load import load_robot
from bellcrank.simulation.simulate import simulate
from bellcrank.sizing.live.live_motion import motion_pieces
from bellcrank.sizing.live.live_sizing import live_sizing
from bellcrank.sizing.size import size
from bellcrank_bench.measurements.dynamics_peers import pinocchio_parallel
from bellcrank_bench.measurements.dynamics_speed import PINOCCHIO, random_states
from bellcrank_bench.measurements.ensemble_row import Duration, EnsembleRow
from bellcrank_bench.measurements.machine import best_of
from bellcrank_bench.measurements.native_loop import loop

if TYPE_CHECKING:
    import casadi
    from playwright.sync_api import Page

Array = NDArray[np.float64]
ROBOTS = ("ur5", "panda")
ROWS = 1000  # of a sizing
BLOCK = 10_000  # states that are in memory at a time
WINDOW = (640, 480)
CHROMIUM = "Chromium, WebAssembly"

# Seconds of `rounds` passes over rows of inputs, and the last outputs; a call reads and writes where the rows are.
SCRIPT = """async ({ code, inputs, sizes, rows, rounds }) => {
  const doubles = inputs.map((text) => new Float64Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer));
  const results = sizes.map((size) => size * rows);
  const begin = 1 << 21;
  const count = doubles.reduce((sum, { length }) => sum + length, 0) + results.reduce((a, b) => a + b, 0);
  const memory = new WebAssembly.Memory({ initial: Math.ceil((begin + 2048 + 8 * count) / 65536) });
  const stack = new WebAssembly.Global({ value: "i32", mutable: true }, begin);
  const library = Object.fromEntries(Object.getOwnPropertyNames(Math).map((name) => [name, Math[name]]));
  const env = { ...library, fmod: (a, b) => a % b, __linear_memory: memory, __stack_pointer: stack };
  const bytes = Uint8Array.from(atob(code), (c) => c.charCodeAt(0));
  const { evaluate } = (await WebAssembly.instantiate(bytes, { env })).instance.exports;
  const [words, numbers] = [new Uint32Array(memory.buffer), new Float64Array(memory.buffer)];
  let at = begin + 2048;
  const take = (length) => (at += 8 * length) - 8 * length;
  const places = doubles.map(({ length }) => take(length));
  places.forEach((place, k) => numbers.set(doubles[k], place / 8));
  const outs = results.map(take);
  const steps = [...doubles.map(({ length }) => 8 * length / rows), ...sizes.map((size) => 8 * size)];
  const first = [...places, ...outs];
  const addresses = [...places.keys(), ...outs.keys()].map((k, i) => begin / 4 + (i < places.length ? k : 64 + k));
  const start = performance.now();
  for (let round = 0; round < rounds; round++) {
    for (let k = 0; k < first.length; k++) words[addresses[k]] = first[k];
    for (let row = 0; row < rows; row++) {
      if (evaluate(begin, begin + 256)) throw new Error("the compiled functions failed");
      for (let k = 0; k < first.length; k++) words[addresses[k]] += steps[k];
    }
  }
  const seconds = (performance.now() - start) / 1000;
  const lastOf = (place, k) => [...numbers.subarray(place / 8 + results[k] - sizes[k], place / 8 + results[k])];
  return { seconds, last: outs.map(lastOf) };
}"""


def page_rows(samples: int, repeats: int) -> list[EnsembleRow]:
    """Inverse dynamics, a sizing's rows and verdict, and a run, in a page and natively.

    Raises InputError where there is no browser, or no Playwright.
    """
    find_browser(), find_playwright()
    sizing, run = size("ur5"), simulate("four_bar")
    with temporary_folder("bench") as folder:
        files = folder / "sizing.html", folder / "run.html"
        replay(sizing, files[0], live=True)
        replay(run, files[1], live=True)
        with open_page(files[0], WINDOW) as page:
            rows = [row for name in ROBOTS for row in _inverse_dynamics(page, name, samples, repeats)]
            rows.append(_sizing(page, sizing, repeats))
        return [*rows, _run(files[1], run, repeats)]


def _in_page(
    page: Page, function: Compiled, inputs: Sequence[Array], rounds: int, repeats: int
) -> tuple[float, list[Array]]:
    """The shortest time, s, of so many passes over rows of inputs (n, m) in a page, and the outputs of the last row."""
    rows = len(inputs[0])
    given = {
        "code": _text(webassembly(function.graph)), "inputs": [_text(each.tobytes()) for each in inputs],
        "sizes": list(function.output_sizes), "rows": rows, "rounds": rounds,
    }  # fmt: skip
    found: list[Any] = [page.evaluate(SCRIPT, given) for _ in range(repeats)]
    return min(one["seconds"] for one in found), [np.array(values) for values in found[-1]["last"]]


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode()


def _compiled(function: casadi.Function) -> Compiled:
    return compiled(f"page {function.name()}", [function.serialize()], lambda: function)


def _natively(function: Compiled, inputs: Sequence[Array]) -> tuple[Callable[[], int], list[Array]]:
    """A pass over rows of inputs by the machine code for one sample, and where it writes."""
    outputs = [np.empty((len(inputs[0]), size)) for size in function.output_sizes]
    return loop(function.address("scalar"), inputs, outputs), outputs


def _error(found: Sequence[Array], outputs: Sequence[Array]) -> float:
    """The largest difference of outputs from the last rows, relative to the largest value of each output."""
    sizes = [float(np.abs(rows).max()) or 1.0 for rows in outputs]
    return max(float(np.abs(a - b[-1]).max()) / size for a, b, size in zip(found, outputs, sizes, strict=True))


def _inverse_dynamics(page: Page, name: str, samples: int, repeats: int) -> list[EnsembleRow]:
    """Inverse dynamics of a robot, a sample, next to the native one and to Pinocchio's."""
    robot = load_robot(name, friction="none")
    rounds = max(1, samples // BLOCK)
    states = random_states(robot, min(samples, BLOCK))
    function, rows = robot.dynamics("inverse_dynamics"), len(states[0])
    run, outputs = _natively(function, states)
    seconds, last = _in_page(page, function, states, rounds, repeats)
    time = Duration(seconds / (rounds * rows))
    many = np.empty((rows, robot.nv))
    bases = {
        "to the native kernel": best_of(run, repeats),
        "to native batches": best_of(function.prepared(states, [many]), repeats),
    }
    pinocchio = pinocchio_parallel(robot, "inverse_dynamics", *states)
    if not isinstance(pinocchio, str):
        bases[f"to {PINOCCHIO}"] = best_of(pinocchio[0], repeats)
    return [
        EnsembleRow(
            subject=name, tool=f"inverse dynamics, {CHROMIUM}", setting="", time=time, base=Duration(base / rows),
            error=_error(last, outputs), note=f"ratio {to}, {base / rows * 1e9:.0f} ns; {rounds * rows:,} samples",
        )
        for to, base in bases.items()
    ]  # fmt: skip


def _sizing(page: Page, sizing: Any, repeats: int) -> EnsembleRow:
    """Rows of the UR5's motions, with the criteria of its motors and gears, and their verdict."""
    live = live_sizing(sizing)
    assert not isinstance(live, str)
    mechanism, (motion, *_), _ = sizing.inputs
    pieces = motion_pieces(motion, mechanism.robot)
    random = np.random.default_rng(0)
    piece = random.integers(0, len(pieces.cuts), ROWS)
    quintic = pieces.cuts[piece, 0].astype(int)
    share = random.uniform(pieces.cuts[piece, 1], pieces.cuts[piece, 2])
    settings = np.array([one.value for one in live.settings])
    states = pieces.states[quintic]
    inputs = [
        np.ascontiguousarray(each)
        for each in (
            states[:, 0], states[:, 1], np.stack([share, pieces.length[quintic]], axis=1), pieces.sides[piece],
            np.ones((ROWS, 1)), np.tile(settings, (ROWS, 1)),
        )
    ]  # fmt: skip
    sample, verdict = _compiled(live.sample), _compiled(live.verdict)
    rows, outputs = _natively(sample, inputs)
    rows()
    reduced = [outputs[1].max(axis=0)[None], outputs[2].mean(axis=0)[None], settings[None]]
    judged, figures = _natively(verdict, reduced)
    base = best_of(rows, repeats) + best_of(judged, repeats)
    seconds, last = _in_page(page, sample, inputs, 10, repeats)
    of_verdict, decided = _in_page(page, verdict, reduced, 100, repeats)
    return EnsembleRow(
        subject="ur5", tool=f"{ROWS:,} rows with verdict, {CHROMIUM}", time=Duration(seconds / 10 + of_verdict / 100),
        base=Duration(base), error=max(_error(last, outputs), _error(decided, figures)),
        note=f"ratio to the native kernels, {base * 1e6:.0f} µs",
    )  # fmt: skip


def _run(path: Path, run: Any, repeats: int) -> EnsembleRow:
    """The four-bar's run until it locks, with start and what the page shows, next to the native integrator's steps."""
    native = min(simulate("four_bar").statistics.kernel_time for _ in range(repeats))
    with open_page(path, WINDOW) as page:
        live = "window.bellcrank.live"
        change = f"async (x) => {{ await {live}.set([[0, x]]); return {live}.seconds; }}"
        stored, end = page.evaluate(f"() => [{live}.values[0], {live}.result.end]")
        seconds = [page.evaluate(change, stored * (1.0 + 1e-9 * (k % 2))) for k in range(1, 2 * repeats)]
    return EnsembleRow(
        subject="four_bar", tool=f"a run of {run.time[-1]:.0f} s, {CHROMIUM}", time=Duration(min(seconds)),
        base=Duration(native), error=abs(end - float(run.time[-1])) / float(run.time[-1]),
        note=f"ratio to the native integrator, {native * 1e3:.2f} ms; error: of the time of the end",
    )  # fmt: skip
