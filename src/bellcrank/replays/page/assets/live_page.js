// ---- a page whose film follows the settings; `liveKind` (live_sizing.js, live_run.js) says what is computed

async function makeLive({ film, player, view, set, panel, charts }) {
  const { live } = film;
  const fail = (text) => panel.prepend(element("section", { id: "live-panel" }, element("p", { className: "live-message", textContent: text })));
  if (typeof WebAssembly === "undefined") return fail("This browser has no WebAssembly: the page replays and does not compute.");
  let state;
  try {
    const compute = await liveKind.load(live);
    state = makeLiveState(live, compute, await compute(Float64Array.from(live.settings, ({ value }) => value)));
    state.agreement = liveKind.agreement(live, state.result);
  } catch (error) {
    return fail(`This page could not compute the ${liveKind.noun} and only replays: ${error.message}`);
  }
  const { section, bar, show } = makeLivePanel(panel, state, liveKind);
  panel.prepend(section);
  window.bellcrank.live = liveFacade(state);
  if (!show) return null;
  byId("main").before(bar);
  const follow = liveKind.follower({ film, player, view, set, panel, charts, state });
  let shown = state.values;
  state.listen(() => {
    show();
    if (shown === state.values) return;
    shown = state.values;
    follow();
    keepInAddress(state);
  });
  show();
  await takeFromAddress(state);
  addEventListener("hashchange", () => takeFromAddress(state));
  return state;
}

/** Positions and quaternions of bodies, from rows of `width` numbers with twelve of each body at its place. */
function posesOf(numbers, rows, width, bodies) {
  const positions = new Float32Array(3 * rows * bodies.length);
  const quaternions = new Float32Array(4 * rows * bodies.length);
  const { Matrix4, Quaternion } = MeshCat.THREE;
  const [matrix, quaternion] = [new Matrix4(), new Quaternion()];
  for (let i = 0; i < rows; i++) {
    bodies.forEach((place, k) => {
      const at = width * i + place;
      const [x, y, z, a, b, c, d, e, f, g, h, j] = numbers.subarray(at, at + 12);
      positions.set([x, y, z], 3 * (i * bodies.length + k));
      quaternion.setFromRotationMatrix(matrix.set(a, b, c, 0, d, e, f, 0, g, h, j, 0, 0, 0, 0, 1)).toArray(quaternions, 4 * (i * bodies.length + k));
    });
  }
  return { positions, quaternions };
}

/** `window.bellcrank.live`, for tests: the settings, their values, and what follows from them. */
const liveFacade = (state) => Object.defineProperties({
  get settings() { return state.live.settings.map(({ group, name, path, entry }) => ({ group, name, path, entry })); },
  get values() { return [...state.values]; },
  /** How many options each setting has; 0 of numbers. */
  get options() { return state.live.settings.map(({ options }) => options?.length ?? 0); },
  get message() { return state.message; },
  get busy() { return state.busy; },
  listen: (listener) => state.listen(listener),
  agreement: state.agreement,
  set: (pairs) => state.set(pairs),
  undo: () => state.undo(),
  reset: () => state.reset(),
  command: () => commandOf(state),
  yaml: () => yamlOf(state),
  /** Seconds that computing everything takes. */
  async time() {
    const before = performance.now();
    await state.compute();
    return (performance.now() - before) / 1000;
  },
}, Object.getOwnPropertyDescriptors(liveKind.facade(state)));
