// ---- charts: lines over time, with a playhead at the player's time

const SHOWN = 8;  // lines of a chart that are visible at first
const HEIGHT = 168;
const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, Arial, sans-serif";

/** The panel beside the view: plots, events and notes. */
async function makePanel(panel, film, player, yieldToBrowser) {
  const range = timeRange(film);
  const zoomed = [...range];
  const plots = [];
  const charts = [];
  const jumps = [];  // [title, section] of everything in the panel
  const bar = makeBar(film, jumps, (factor) => {
    const [low, high] = zoomed;
    const centre = Math.min(Math.max(player.time, low), high);
    zoomTo(factor === 0 ? range : [centre - (centre - low) * factor, centre + (high - centre) * factor]);
  });
  const zoomTo = ([low, high]) => {
    const least = (range[1] - range[0]) * 1e-6;
    if (high - low < least) return;
    zoomed.splice(0, 2, Math.max(low, range[0]), Math.min(high, range[1]));
    for (const { plot } of charts) plot.setScale("x", { min: zoomed[0], max: zoomed[1] });
    queueMicrotask(() => {  // after the scales are set: another time is now under a pointer at rest
      const under = charts.find(({ plot }) => plot.over.matches(":hover"))?.plot;
      if (under) under.setCursor({ left: under.cursor.left, top: under.cursor.top }, true, true);
    });
  };
  const shared = { film, player, range, zoomed, zoomTo, bar, plots: charts, jumps, hover: null };

  if (film.charts.length) panel.append(bar.box);
  if (film.events.length) panel.append(makeEvents(film, player));
  panel.append(makeNotes(film));
  const before = panel.querySelector(".events, .notes");
  const first = film.charts.findIndex(({ title }) => !/torque|force/.test(title));
  const ahead = first > 0 ? first : film.charts.length;  // XY plots follow the torques
  const xyPlots = element("div", { className: "xy-plots" });
  const addCharts = async (some) => {
    for (const chart of some) {
      charts.push(makeChart(panel, before, chart, shared));
      await yieldToBrowser();  // the view stays responsive while many plots are made
    }
  };
  await addCharts(film.charts.slice(0, ahead));
  if (film.xy_plots.length) panel.insertBefore(xyPlots, before);
  for (const data of film.xy_plots) {
    plots.push(makeXYPlot(xyPlots, data, shared));
    await yieldToBrowser();
  }
  await addCharts(film.charts.slice(ahead));
  plots.push(...charts);
  if (film.events.length) jumps.push(["events", panel.querySelector(".events")]);
  bar.fill();
  const follow = (t) => {
    const [low, high] = zoomed;
    if (t < low || t > high) zoomTo([t - (high - low) * 0.1, t + (high - low) * 0.9]);  // scroll on
    for (const plot of plots) plot.follow(t);
    showValues(shared);
  };
  player.listen(follow);
  follow(player.time);
  let width = panel.clientWidth;
  new ResizeObserver(() => {
    if (panel.clientWidth === width || panel.clientWidth === 0) return;
    width = panel.clientWidth;
    for (const { resize } of plots) resize();
    follow(player.time);
  }).observe(panel);
  darkScheme.addEventListener("change", () => {
    for (const { plot, recolour } of plots) {
      recolour();
      plot.redraw(false, true);
    }
  });
  return { charts, plots, range, storedRange: [...range], showAll: () => zoomTo(range), follow: () => follow(player.time) };
}

function timeRange({ time, charts }) {
  const all = [time, ...charts.map((chart) => chart.time)].filter((times) => times.length);
  const low = Math.min(...all.map((times) => times[0]));
  const high = Math.max(...all.map((times) => times.at(-1)));
  return low < high ? [low, high] : [low - 0.5, high + 0.5];
}

/** The bar above the plots: the time of the values, a list of the plots, and zoom buttons. */
function makeBar(film, jumps, zoom) {
  const button = (label, path, factor) => {
    const made = element("button", { className: "icon", ariaLabel: label, title: label, onclick: () => zoom(factor) });
    made.innerHTML = `<svg viewBox="0 0 24 24"><path d="${path}"/></svg>`;  // constant markup, no data
    return made;
  };
  const valuesLabel = element("span", {});
  const jump = element("select", { ariaLabel: "Go to a plot", title: "Go to a plot", hidden: true });
  jump.onchange = () => {
    jumps[Number(jump.value)][1].scrollIntoView({ behavior: reducedMotion.matches ? "auto" : "smooth", block: "start" });
    jump.value = "";
  };
  const fill = () => {
    jump.replaceChildren(element("option", { value: "", textContent: "go to plot …", hidden: true }),
      ...jumps.map(([title], k) => element("option", { value: k, textContent: title })));
    jump.value = "";
    jump.hidden = jumps.length < 4;
  };
  const box = element("div", { className: "bar" }, valuesLabel, jump,
    button("Zoom in on the time", "M11 4a7 7 0 1 0 0 14 7 7 0 0 0 0-14zM16 16l4.500 4.500M8 11h6M11 8v6", 0.5),
    button("Zoom out", "M11 4a7 7 0 1 0 0 14 7 7 0 0 0 0-14zM16 16l4.500 4.500M8 11h6", 2),
    button("Show the whole time", "M4 7v10M20 7v10M7 12h10M9.500 9.500 7 12l2.500 2.500M14.500 9.500 17 12l-2.500 2.500", 0));
  return { box, valuesLabel, fill };
}

function makeEvents(film, player) {
  const listed = film.events.slice(0, 200);
  const section = element("section", { className: "chart events" }, element("h2", { textContent: "Events" }));
  section.append(...listed.map(({ time, text }) => element("button", { onclick: () => { player.pause(); player.seek(time); } },
    element("time", { textContent: `${formatNumber(time, 5)} s` }), element("span", { className: "name", textContent: text }))));
  if (film.events.length > listed.length) section.append(element("p", { className: "notes", textContent: `and ${film.events.length - listed.length} more` }));
  return section;
}

function makeNotes(film) {
  return element("div", { className: "notes" }, ...film.notes.map((note) => element("p", { textContent: note })));
}

/** A chart: title, plot, and a legend whose entries toggle lines and show values. */
function makeChart(panel, before, chart, shared) {
  const { player, range, zoomed } = shared;
  const lines = chart.lines.map(({ name, time, samples, values }, k) => ({ name, time, samples, values: chart.logarithmic ? values : withGaps(values), raw: values, k, on: k < SHOWN }));
  const positive = chart.logarithmic ? logarithmicFloor(chart.lines) : 0;
  if (chart.logarithmic) for (const line of lines) line.values = raiseToFloor(line.raw, positive);
  const usual = chart.logarithmic ? 0 : usualMagnitude(chart.time, lines.map(({ raw }) => raw));
  const few = chart.time.length <= 3;
  const noise = NOISE * Math.max(...lines.map(({ raw }) => largest(raw)));
  const title = element("b", { textContent: chart.title });
  const box = element("section", { className: "chart" }, element("header", {}, title,
    element("span", { textContent: `[${formatUnit(chart.unit)}]${chart.logarithmic ? ", logarithmic" : usual ? `, logarithmic above ${formatNumber(usual, 2)}` : ""}${toleranceText(chart.tolerance, shared.film.tolerance)}` })));
  panel.insertBefore(box, before);
  const twice = shared.film.charts.filter(({ title }) => title === chart.title).length > 1;
  shared.jumps.push([twice ? `${chart.title} [${formatUnit(chart.unit)}]` : chart.title, box]);
  const style = axisStyle();
  const plot = new uPlot({
    width: widthOf(panel),
    height: HEIGHT,
    ms: 1,
    scales: {
      x: { time: false, range: (_, low, high) => (low === null ? range : [low, high]) },
      y: positive > 0 ? { distr: 3, range: decadeRange } : usual > 0 ? { distr: 4, asinh: usual, range: widenedRange } : { distr: 1, range: valueRange },
    },
    axes: [{ ...style, size: 26, values: (u, ticks) => ticks.map(tickText) }, { ...style, size: axisWidth, values: (u, ticks) => ticks.map(tickText), 
      ...(positive > 0 && { splits: powersOfTen, filter: (u, ticks) => ticks }),
      ...(usual > 0 && { splits: (u, axis, low, high) => symmetricPowers(usual, low, high), filter: (u, ticks) => ticks }),
    }],
    series: [{}, ...lines.map(({ k, on }) => ({
      show: on, stroke: () => paletteColour(k), width: 1.5, dash: DASHES[Math.floor(k / PALETTE.length) % DASHES.length],
      points: { show: few, size: 7 }, spanGaps: false, pxAlign: 0, paths: straightPath,
    }))],
    cursor: { drag: { x: false, y: false }, y: false, sync: { key: "bellcrank", setSeries: false }, points: { size: 6 } },
    legend: { show: false },
    hooks: {
      setCursor: [(u) => {
        const at = u.cursor.idx;
        shared.hover = at === null || at === undefined || u.cursor.left < 0 ? null : u.posToVal(u.cursor.left, "x");
        if (!player.playing) showValues(shared);
      }],
      drawAxes: [(u) => drawEvents(u, shared.film.events)],
    },
  }, [chart.time, ...lines.map(({ values }) => values)], box);
  plot.setScale("x", { min: zoomed[0], max: zoomed[1] });
  const playhead = element("div", { className: "playhead" });
  plot.over.append(playhead);
  const follow = (t) => { playhead.style.transform = `translateX(${plot.valToPos(t, "x")}px)`; };
  plot.hooks.draw = [() => follow(player.time)];  // the scale may have changed
  seekByDragging(plot.over, player, (x) => plot.posToVal(x, "x"));
  plot.over.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return;  // without ctrl the panel scrolls
    event.preventDefault();
    const centre = plot.posToVal(event.offsetX, "x");
    const factor = Math.exp(0.002 * event.deltaY);
    shared.zoomTo([centre - (centre - zoomed[0]) * factor, centre + (zoomed[1] - centre) * factor]);
  }, { passive: false });
  plot.over.addEventListener("dblclick", () => shared.zoomTo(range));

  let ghosts = 0;  // how many lines of another run there are
  const outputs = lines.map((line) => legendEntry(line, (on) => {
    plot.setSeries(line.k + 1, { show: on });
    if (ghosts) plot.setSeries(ghosts + line.k + 1, { show: on });
    showValues(shared);
  }));
  box.append(collapsedLegend(outputs.map(({ button }) => button)));
  return {
    plot,
    chart,
    title,
    box,
    /** Other times, and other values of each line there; with those of another run, drawn dashed. */
    replace(time, columns, others = null) {
      const fit = (values) => (chart.logarithmic ? raiseToFloor(values, positive) : withGaps(values));
      chart.time = time;
      lines.forEach((line, k) => Object.assign(line, { time, samples: columns[k], raw: columns[k], values: fit(columns[k]) }));
      if (others && !ghosts) {
        ghosts = lines.length;
        for (const { k, on } of lines) plot.addSeries({ show: on, stroke: () => paletteColour(k), alpha: 0.45, width: 1.2, dash: [2, 3], points: { show: false }, spanGaps: false, pxAlign: 0, paths: straightPath });
      }
      plot.setData([time, ...lines.map(({ values }) => values), ...lines.slice(0, ghosts).map((_, k) => (others ? fit(others[k]) : Array(time.length).fill(null)))], false);
    },
    resize: () => plot.setSize({ width: widthOf(panel), height: HEIGHT }),
    recolour: () => {
      Object.assign(style, axisStyle());
      for (const axis of plot.axes) Object.assign(axis, { stroke: () => style.stroke(), grid: { ...axis.grid, ...style.grid } });
      for (const { swatch, line } of outputs) swatch.style.color = paletteColour(line.k);
    },
    follow,
    showValues: (t) => {
      for (const { output, line } of outputs) {
        const value = valueAt(line.time, line.samples, t);
        const text = line.on ? `${chart.tolerance === null ? "≈ " : ""}` + formatNumber(Math.abs(value) < noise && !chart.logarithmic ? 0 : value) : "";
        if (output.textContent !== text) output.textContent = text;
      }
    },
  };
}

let lastShown = 0;
/** Shows values at the pointer, else at the player's time, at most ten times a second while playing. */
function showValues(shared) {
  const { player, hover, bar, plots } = shared;
  if (player.playing && hover === null && performance.now() - lastShown < 100) return;
  lastShown = performance.now();
  const t = hover ?? player.time;
  const text = `values at ${t.toFixed(3)} s`;
  if (bar.valuesLabel.textContent !== text) bar.valuesLabel.textContent = text;
  for (const plot of plots) plot.showValues(t);
}

/** The value at a time, interpolated linearly between samples; NaN beside a gap. */
function valueAt(times, values, t) {
  if (!times.length || t < times[0] || t > times.at(-1)) return NaN;
  const [index, part] = interpolationAt(times, t);
  const [a, b] = [values[index], values[index + 1]];
  return part < 1e-6 ? a : part > 1 - 1e-6 ? b : a + part * (b - a);  // at a sample beside a gap it is the sample
}

/** Axes in the page's colours. */
function axisStyle() {
  const rule = cssVariable("--rule");
  return {
    font: FONT, labelFont: FONT, labelSize: 18, gap: 4,
    stroke: () => cssVariable("--muted"), grid: { stroke: rule, width: 1 }, ticks: { show: false },
  };
}

const widthOf = (panel) => Math.max(panel.clientWidth - 2 * parseFloat(getComputedStyle(panel).paddingLeft), 120);

function drawEvents(u, events) {
  const { ctx: pen, bbox } = u;
  pen.save();
  pen.strokeStyle = cssVariable("--event");
  pen.lineWidth = devicePixelRatio;
  pen.setLineDash([4 * devicePixelRatio, 3 * devicePixelRatio]);
  pen.globalAlpha = 0.7;
  pen.beginPath();
  for (const { time } of events) {
    const x = Math.round(u.valToPos(time, "x", true)) + 0.5;
    if (x < bbox.left || x > bbox.left + bbox.width) continue;
    pen.moveTo(x, bbox.top);
    pen.lineTo(x, bbox.top + bbox.height);
  }
  pen.stroke();
  pen.restore();
}

/** A click or drag on `over` moves the player to the time at the pointer. */
function seekByDragging(over, player, timeAt) {
  let left = 0;
  let dragged = null;
  const go = (event) => player.seek(timeAt(event.clientX - left, event));
  over.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    dragged = event.pointerId;
    left = over.getBoundingClientRect().left;
    over.setPointerCapture(dragged);
    player.hold();
    go(event);
  });
  over.addEventListener("pointermove", (event) => { if (event.pointerId === dragged) go(event); });
  for (const end of ["pointerup", "pointercancel"]) {
    over.addEventListener(end, (event) => {
      if (event.pointerId !== dragged) return;
      dragged = null;
      player.release();
    });
  }
}

function legendEntry(line, toggle) {
  const swatch = element("i", { className: "swatch" });
  swatch.style.color = paletteColour(line.k);
  const output = element("output", {});
  const button = element("button", { title: line.name, ariaPressed: String(line.on) }, swatch,
    element("span", { className: "name", textContent: line.name }), output);
  button.onclick = () => {
    line.on = !line.on;
    button.ariaPressed = String(line.on);
    toggle(line.on);
  };
  return { button, swatch, output, line };
}

/** A legend with its first entries, and a button for the others. */
function collapsedLegend(buttons) {
  const legend = element("div", { className: "legend" }, ...buttons.slice(0, SHOWN));
  const rest = buttons.slice(SHOWN);
  if (rest.length) {
    const more = element("button", { textContent: `${rest.length} more …`, ariaLabel: `Show ${rest.length} more lines` });
    more.onclick = () => more.replaceWith(...rest);
    legend.append(more);
  }
  return legend;
}
