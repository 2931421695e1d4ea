// ---- the page of a study: its map, and the design that is chosen and moves

/** The study, as study_data.py wrote it, with arrays in place of references. */
async function readStudy() {
  const study = JSON.parse(byId("study").textContent);
  const bytes = await window.bellcrank.inflated("study-arrays");
  const read = (reference, Kind) => decodeArray(bytes, reference, Kind);
  for (const column of study.columns) column.values = read(column.values);
  for (const name of ["number", "status", "reason"]) study[name] = read(study[name], Int32Array);
  study.shown = [...read(study.shown, Int32Array)];
  const decoded = new Map();
  /** The motion of the k-th design that is shown. */
  study.motion = (k) => {
    if (!decoded.has(k)) {
      const { time, positions, quaternions, springs, rods, ...rest } = study.motions[k];
      const motion = { ...rest, time: read(time, Float64Array), positions: read(positions), quaternions: read(quaternions) };
      motion.springs = springs.map((each) => read(each));
      motion.rods = rods.map((each) => read(each));
      const width = motion.positions.length / motion.time.length;
      motion.traces = study.traced.map((body) => [{ time: motion.time, points: pathOf(motion.positions, width, body) }]);
      decoded.set(k, motion);
    }
    return decoded.get(k);
  };
  return study;
}

/** The positions of one body, from rows of `width` numbers. */
function pathOf(positions, width, body) {
  const path = new Float32Array(positions.length / width * 3);
  for (let row = 0; row * width < positions.length; row++) path.set(positions.subarray(row * width + 3 * body, row * width + 3 * body + 3), 3 * row);
  return path;
}

/** What is known of a design: its status, parameters and measures. */
function designFacts(study, row) {
  const reason = study.reasons[study.reason[row]] ?? "";
  const lines = study.columns.map(({ name, unit, values }) => element("tr", {}, element("th", { textContent: name }),
    element("td", { textContent: `${formatNumber(values[row], 6)} ${unit === "1" ? "" : formatUnit(unit)}` })));
  return [
    element("h3", { textContent: `Design ${study.number[row].toLocaleString("en")}: ${study.statuses[study.status[row]]}` }),
    ...reason ? [element("p", { textContent: reason })] : [],
    element("table", { className: "facts" }, ...lines),
  ];
}

/** The values of the settings of a design, with their numbers. */
const settingsOf = (study, row) => study.settings.map(({ setting, factor, inverse }, k) => {
  const value = study.values[row][k];
  return [setting, inverse ? factor / value : factor * value];
});

/** Whether the page computes with the values of a design, or is about to. */
const isDesign = ({ live }, study, row) => live.busy || settingsOf(study, row).every(([k, value]) => live.values[k] === value);

/** Compute a design, in place of one that is kept. */
async function computeDesign(b, study, row, play) {
  if (!await b.live?.set(settingsOf(study, row))) return;
  b.seek(b.start);
  if (play && !reducedMotion.matches) b.play();
}

/** A choice of one column of the study. */
function columnChoice(study, title, chosen, change) {
  const select = element("select", {}, ...study.columns.map(({ name }, k) => element("option", { value: k, textContent: name, selected: k === chosen })));
  select.onchange = () => change(Number(select.value));
  return element("label", {}, element("span", { textContent: title }), select);
}

function showStudy(study) {
  const b = window.bellcrank;
  const panel = byId("panel");
  const [choices, place, facts] = [element("div", { className: "map-choices" }), element("div", {}), element("div", { className: "design-facts", ariaLive: "polite" })];
  const hint = element("p", { className: "hint", textContent: study.hint });
  panel.prepend(element("section", { className: "design-map", ariaLabel: "Map of the designs" }, choices, place, hint, facts));
  const chosen = study.chosen;  // columns by x, y, colour
  let map = null;
  let current = study.settings ? null : study.shown[0];  // null: none, as where sliders stand between designs
  const show = (row, play) => {
    current = row;
    map.mark(row);
    facts.replaceChildren(...designFacts(study, row));
    if (study.settings) return void computeDesign(b, study, row, play);
    const k = study.shown.indexOf(row);
    if (k < 0) return;  // a design that failed has no motion
    b.showMotion(study.motion(k));
    b.seek(b.start);
    if (play && !reducedMotion.matches) b.play();
  };
  const draw = () => {
    const [x, y, colour] = ["x", "y", "colour"].map((name) => study.columns[chosen[name]]);
    map = makeDesignMap({ x, y, colour, limits: study.limits, shown: study.shown, width: Math.max(panel.clientWidth - 28, 280), pick: (row) => show(row, true) });
    place.replaceChildren(map.box);
    map.mark(current);
  };
  for (const [name, title] of [["x", "horizontal"], ["y", "vertical"], ["colour", "colour"]]) {
    choices.append(columnChoice(study, title, chosen[name], (column) => {
      chosen[name] = column;
      draw();
    }));
  }
  const walk = (step) => show(study.shown[(Math.max(study.shown.indexOf(current), 0) + step + study.shown.length) % study.shown.length], true);
  for (const [text, step] of [["Previous", -1], ["Next", 1]]) {
    choices.append(element("button", { type: "button", textContent: step < 0 ? "‹" : "›", ariaLabel: `${text} design`, title: `${text} design that can move`, onclick: () => walk(step) }));
  }
  draw();
  if (current !== null) show(current, false);
  b.live?.listen(() => {
    if (current === null || isDesign(b, study, current)) return;
    current = null;
    map.mark(null);
    facts.replaceChildren();
  });
  let width = panel.clientWidth;
  new ResizeObserver(() => {
    if (panel.clientWidth === width || !panel.clientWidth) return;
    width = panel.clientWidth;
    draw();
  }).observe(panel);
  b.study = {  // for tests
    get current() { return current === null ? null : study.number[current]; },
    shown: study.shown.map((row) => study.number[row]),
    show: (k) => show(study.shown[k], false),
    pixel: (k) => map.pixel(study.shown[k]),
  };
}

const replayReady = window.bellcrank.ready;
window.bellcrank.ready = replayReady.then(async () => {
  showStudy(await readStudy());
  if (byId("still") && byId("pane").firstChild) drawStill(byId("still"));  // with the links of the design
});
