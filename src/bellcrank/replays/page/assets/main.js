// ---- the page

function fillTexts(film, licences) {
  byId("facts").append(...film.facts.map(([name, value]) => element("div", {}, element("dt", { textContent: name }), element("dd", { textContent: value }))));
  byId("facts").classList.toggle("bad", !film.success);
  collapseFacts();
  const notes = [
    `Bodies are drawn within ${formatNumber(film.error_bound * 1000, 2)} mm of a smooth curve through the rows of the run.`,
    ...film.charts.length ? [`Plotted lines are accurate to ${fraction(film.tolerance)} of their range, unless the plot states otherwise; both sides of a jump are shown.`] : [],
    ...film.notes,
    `This page is self-contained and fetches nothing. The viewer of meshcat 0.3.2 draws the 3-D view${typeof uPlot === "undefined" ? "" : ", uPlot 1.6.32 the plots"}.`,
  ];
  byId("notes").append(...notes.map((note) => element("li", { textContent: note })));
  byId("licences").querySelector("pre").textContent = licences;
  document.body.classList.toggle("alone", !film.charts.length && !film.xy_plots.length);
}

/** A share as 1/n. */
const fraction = (share) => `1/${Math.max(Math.floor(1 / share), 1).toLocaleString("en")}`;

/** The statement of a plot that is less accurate than the page's tolerance. */
const toleranceText = (tolerance, usual) => (tolerance === null ? ", extremes only: values between them are unknown"
  : tolerance > 0.25 ? ", accurate only at the run's rows, which are too far apart"
  : tolerance > 1.01 * usual ? `, accurate to ${fraction(tolerance)} of a line's range` : "");

/** Shows the first line of facts, and a button for all of them. */
function collapseFacts() {
  const [facts, more] = [byId("facts"), byId("more")];
  const fold = () => {
    const all = facts.classList.contains("all");
    facts.style.maxHeight = all ? "" : `min(${facts.firstElementChild?.offsetHeight ?? 0}px, 30vh)`;
    if (!all) more.hidden = facts.scrollHeight <= facts.clientHeight + 2;
    more.ariaExpanded = String(all);
    more.textContent = all ? "fewer facts" : "all facts";
  };
  new ResizeObserver(fold).observe(byId("header"));
  more.onclick = () => {
    facts.classList.toggle("all");
    fold();
  };
}

/** The list of what can be shown and hidden, in groups; a large group has a switch for all. */
function makeLayers(view, film) {
  const box = byId("layers");
  const button = byId("layers-button");
  const set = (layer, on) => {
    layer.on = on;
    if (layer.box) layer.box.checked = on;
    for (const object of layer.objects) object.visible = on;
    layer.change?.(on);
    view.refresh();
    byId("scale").textContent = scaleLegend(film, view);
  };
  const row = (name, colour, on, change) => {
    const input = element("input", { type: "checkbox", checked: on, onchange: () => change(input.checked) });
    const swatch = element("i", { className: "swatch" });
    swatch.style.color = colour;
    box.append(element("label", { title: name }, input, swatch, element("span", { className: "name", textContent: name })));
    return input;
  };
  for (const group of new Set(view.layers.map((layer) => layer.group))) {
    box.append(element("h2", { textContent: group }));
    const members = view.layers.filter((layer) => layer.group === group);
    if (members.length > 3) row("all", "transparent", members.every(({ on }) => on), (on) => members.forEach((layer) => set(layer, on)));
    for (const layer of members) layer.box = row(layer.name, layer.colour, layer.on, (on) => set(layer, on));
  }
  for (const scale of film.scales) box.append(element("p", { textContent: scaleText(scale, true) }));
  for (const layer of view.layers) set(layer, layer.on);
  byId("scale").textContent = scaleLegend(film, view);
  const open = (on) => {
    box.hidden = !on;
    button.ariaExpanded = String(on);
  };
  button.onclick = () => open(box.hidden);
  document.addEventListener("pointerdown", ({ target }) => { if (!box.contains(target) && !button.contains(target)) open(false); });
  document.addEventListener("keydown", ({ key }) => { if (key === "Escape") open(false); });
  return set;
}

/** The legend in the corner: the scales of visible arrows, and the grid. */
function scaleLegend(film, { layers, gridStep }) {
  const arrows = layers.filter(({ group }) => group === "Arrows");
  const seen = film.scales.filter((scale) => scale.arrows.some((k) => arrows[k].on));
  const texts = seen.map((scale) => scaleText(scale, false)).filter(Boolean);
  if (film.ground) texts.push(`grid ${formatNumber(gridStep())} m${film.ground.height ? `, at ${formatNumber(film.ground.height)} m` : ""}`);
  return texts.join("\n");
}

async function open(licences) {
  const film = await readFilm();
  const options = new URLSearchParams(location.hash.slice(1));
  document.body.classList.toggle("still", options.get("still") === "1");
  fillTexts(film, licences);
  const panel = byId("panel");
  panel.hidden = !(film.charts.length || film.xy_plots.length || film.events.length || film.notes.length);
  const view = makeView(byId("pane"), film);
  const player = makePlayer(film);
  const set = view && makeLayers(view, film);
  byId("message").textContent = view ? "" : "The 3-D view is not available: this browser has no WebGL.\nThe plots work without it.";
  const reset = () => view?.resetCamera();
  makeControls(player, film, reset);
  byId("reset").onclick = reset;
  byId("reset").hidden = !view;
  byId("layers-button").hidden = !view?.layers.length;
  if (view) player.listen(view.showTime);
  const fromHash = () => {
    const text = new URLSearchParams(location.hash.slice(1)).get("t");
    if (text !== null) player.seek(Number(text));
  };
  fromHash();
  addEventListener("hashchange", fromHash);
  player.notify();
  view?.draw();
  Object.defineProperties(window.bellcrank, Object.getOwnPropertyDescriptors(makeFacade(film, view, player, set)));
  const yieldToBrowser = () => new Promise((resolve) => { setTimeout(resolve); });
  await yieldToBrowser();
  const charts = panel.hidden ? null : await makePanel(panel, film, player, yieldToBrowser);
  if (film.live && charts) await makeLive({ film, player, view, set, panel, charts });
  if (options.get("play") === "1" && !reducedMotion.matches) player.play();
}

/**
 * `window.bellcrank`, for stills, films and tests: times in s, points in m in the world frame, pixels of the view.
 *
 *   ready             a promise: the film is decoded, the first frame drawn, and the plots are made
 *   start end duration frames   of the film;  firstFrame  when it was drawn, ms since the page was opened
 *   time playing      the current state;  speed, loop  can be set
 *   seek(t) play() pause() step(count)   like the controls
 *   draw()            draws, waits for the image, and returns the time it took (ms)
 *   capture(paper)    the view as the data URL of a PNG; with a white background for paper
 *   frameTimes        ms between the last frames that were drawn while playing, at most 600
 *   project(point)    the pixel of a point of the world
 *   pose(body)        position and quaternion (x y z w) of a body as drawn, by its number
 *   showBody(body, on) layers() showLayer(index, on) resetCamera()   visibility and camera
 *   showMotion(motion)   another motion of the same bodies
 */
function makeFacade(film, view, player, setLayer) {
  return {
    firstFrame: performance.now(),
    start: player.start,
    end: player.end,
    duration: player.end - player.start,
    frames: film.time.length,
    get time() { return player.time; },
    get playing() { return player.playing; },
    get speed() { return player.speed; },
    set speed(speed) { player.setSpeed(speed); },
    get loop() { return player.loop; },
    set loop(loop) { player.setLoop(loop); },
    get frameTimes() { return [...player.frameTimes]; },
    seek: player.seek,
    play: player.play,
    pause: player.pause,
    step: player.step,
    draw() {
      const before = performance.now();
      view.drawFully();
      return performance.now() - before;
    },
    capture: (paper = false) => view.capture(paper),
    project: (point) => view.project(point),
    pose: (body) => [...view.bodies[body].position.toArray(), ...view.bodies[body].quaternion.toArray()],
    showBody(body, on) {
      view.bodies[body].visible = on;
      view.refresh();
    },
    layers: () => view.layers.map(({ group, name, on }) => ({ group, name, on })),
    showLayer(index, on) { setLayer(view.layers[index], on); },
    resetCamera: () => view.resetCamera(),
    /** Show another motion of the same bodies, as view.js does, with its events on the time line. */
    showMotion(motion) {
      film.events.splice(0, film.events.length, ...motion.events);
      view?.showMotion(motion);
      player.notify();
    },
  };
}

window.bellcrank.open = open;
