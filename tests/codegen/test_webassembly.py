"""Inverse dynamics as WebAssembly in a real browser against the machine code of the same expression graph."""

import base64

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.codegen.expression_graph import graph_of
from bellcrank.codegen.webassembly import webassembly

pytest_plugins = ("browser",)

# Evaluates the module for rows of inputs, as the page does; sine and cosine of large angles are the browser's.
SCRIPT = """async ({ code, rows, sizes }) => {
  const bytes = Uint8Array.from(atob(code), (letter) => letter.charCodeAt(0));
  const memory = new WebAssembly.Memory({ initial: 64 });
  const stack = new WebAssembly.Global({ value: "i32", mutable: true }, 1 << 21);
  const library = Object.fromEntries(Object.getOwnPropertyNames(Math).map((name) => [name, Math[name]]));
  const env = { ...library, __linear_memory: memory, __stack_pointer: stack };
  const { instance } = await WebAssembly.instantiate(bytes, { env });
  const [addresses, numbers] = [new Uint32Array(memory.buffer), new Float64Array(memory.buffer)];
  const begin = 1 << 21;
  let place = begin + 1024;
  sizes.forEach((size, k) => { addresses[begin / 4 + k] = place; place += 8 * size; });
  addresses[begin / 4 + 64] = place;
  return rows.map((row) => {
    numbers.set(row, (begin + 1024) / 8);
    const status = instance.exports.evaluate(begin, begin + 256);
    return status ? null : [...numbers.slice(place / 8, place / 8 + sizes[0])];
  });
}"""


def module_and_graph(robot):
    graph = graph_of(robot.equations.dynamics("inverse_dynamics").serialize().encode("latin-1"))
    return webassembly(graph), graph


@pytest.mark.parametrize("name", ["ur5", "panda", "planar_2r", "five_bar"])
def test_module_is_small_and_the_same_every_time(name):
    robot = bc.load_scene(name).robot
    code, graph = module_and_graph(robot)
    assert code[:8] == b"\0asm\1\0\0\0" and code == webassembly(graph)
    assert len(code) < 3000 + 12 * graph.operations  # bytes: no table, no data, no debugging information


@pytest.mark.tier2
@pytest.mark.parametrize("name", ["ur5", "panda", "planar_2r", "five_bar"])
def test_inverse_dynamics_in_the_browser_is_the_native(chromium, name):
    robot = bc.load_scene(name).robot
    code, _ = module_and_graph(robot)
    rng = np.random.default_rng(1)
    q, v, a = rng.uniform(-3.0, 3.0, (3, 100, robot.nv))
    q[0] *= 1e6  # beyond the range of the polynomials
    expected = robot.inverse_dynamics(q, v, a)
    page = chromium.new_page()
    rows = np.hstack([q, v, a]).tolist()
    given = {"code": base64.b64encode(code).decode(), "rows": rows, "sizes": [robot.nv] * 3}
    found = np.array(page.evaluate(SCRIPT, given))
    page.close()
    np.testing.assert_allclose(found[1:], expected[1:], rtol=0, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_allclose(found[0], expected[0], rtol=0, atol=1e-9 * np.abs(expected).max())
