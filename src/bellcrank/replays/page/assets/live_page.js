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

/** `window.bellcrank.live`, for tests: the settings, their values, and what follows from them. */
const liveFacade = (state) => Object.defineProperties({
  get settings() { return state.live.settings.map(({ group, name, path, entry }) => ({ group, name, path, entry })); },
  get values() { return [...state.values]; },
  get message() { return state.message; },
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
