// ---- XY plots: one quantity over another, with limits, and a dot at the current time

const SEEN = 0.2;  // pixels between two points that are both drawn

/** uPlot draws the axes; the curve and its limits, whose x is not increasing, are drawn here. */
function makeXYPlot(panel, data, shared) {
  const { player, jumps } = shared;
  let { x, y, time, limits } = data;
  const box = element("section", { className: "chart xy-plot" }, element("header", {}, element("b", { textContent: data.title }),
    ...[toleranceText(data.tolerance, shared.film.tolerance).slice(2)].filter(Boolean).map((text) => element("span", { textContent: text }))));
  panel.append(box);
  jumps.push([data.title, box]);
  const style = axisStyle();
  const ranges = () => [0, 1].map((k) => paddedRange([k ? y : x, ...limits.map(({ points }) => points.filter((_, i) => i % 2 === k))]));
  let [across, up] = ranges();
  const plot = new uPlot({
    width: widthOf(box),
    height: xyPlotHeight(box),
    scales: { x: { time: false, range: () => across }, y: { range: () => up } },
    axes: [
      { ...style, size: 26, space: 46, label: data.x_label, values: (u, ticks) => ticks.map(tickText) },
      { ...style, size: 50, label: data.y_label, values: (u, ticks) => ticks.map(tickText) },
    ],
    series: [{}, { show: true, stroke: "transparent" }],
    cursor: { show: false },
    legend: { show: false },
    hooks: { draw: [(u) => drawXYPlot(u, data)] },
  }, [across, [null, null]], box);
  const dot = element("div", { className: "dot" });
  plot.over.append(dot);
  const value = element("output", {});
  const legend = element("div", { className: "legend" }, ...limits.map(({ name }, k) => legendName(name, paletteColour(k + 1))));
  legend.append(value);
  box.append(legend);

  const nearest = (clientX, clientY) => {
    const frame = plot.over.getBoundingClientRect();
    let best = 0;
    let least = Infinity;
    for (let i = 0; i < time.length; i++) {
      const d = (plot.valToPos(x[i], "x") - (clientX - frame.left)) ** 2 + (plot.valToPos(y[i], "y") - (clientY - frame.top)) ** 2;
      if (d < least) [least, best] = [d, i];
    }
    return best;
  };
  const [noiseX, noiseY] = [x, y].map((values) => NOISE * largest(values));
  const format = (v, noise) => formatNumber(Math.abs(v) < noise ? 0 : v);
  const showPoint = (a, b, t) => { value.textContent = `${format(a, noiseX)}, ${format(b, noiseY)} at ${t.toFixed(3)} s`; };
  if (time.length) seekByDragging(plot.over, player, (_, event) => time[nearest(event.clientX, event.clientY)]);
  plot.over.addEventListener("pointermove", ({ clientX, clientY, buttons }) => {
    const i = nearest(clientX, clientY);
    if (!buttons && time.length) showPoint(x[i], y[i], time[i]);
  });
  const follow = (t) => {
    const [a, b] = [valueAt(time, x, t), valueAt(time, y, t)];
    dot.hidden = !(Number.isFinite(a) && Number.isFinite(b));
    if (!dot.hidden) dot.style.transform = `translate(${plot.valToPos(a, "x")}px, ${plot.valToPos(b, "y")}px)`;
    if (!player.playing) showPoint(a, b, t);
  };
  plot.over.addEventListener("pointerleave", () => follow(player.time));
  return {
    plot,
    data,
    title: box.querySelector("b"),
    follow,
    /** Another curve and other limits of the same names. */
    replace(curve) {
      ({ x, y, time, limits } = Object.assign(data, curve));
      [across, up] = ranges();
      plot.setData([across, [null, null]]);
    },
    resize: () => plot.setSize({ width: widthOf(box), height: xyPlotHeight(box) }),
    recolour: () => {
      const { grid } = axisStyle();
      for (const axis of plot.axes) axis.grid = { ...axis.grid, ...grid };
    },
  };
}

const xyPlotHeight = (box) => Math.min(Math.max(0.62 * widthOf(box), 190), 340);

/** The range of all finite values, with a margin. */
function paddedRange(arrays) {
  let [low, high] = [Infinity, -Infinity];
  for (const values of arrays) {
    for (const v of values) {
      if (!Number.isFinite(v)) continue;
      low = Math.min(low, v);
      high = Math.max(high, v);
    }
  }
  return low <= high ? valueRange(null, low, high) : [-1, 1];
}

function legendName(name, colour) {
  const swatch = element("i", { className: "swatch" });
  swatch.style.color = colour;
  return element("button", { disabled: true, title: name, style: "opacity: 1" }, swatch, element("span", { className: "name", textContent: name }));
}

function drawXYPlot(u, { x, y, limits }) {
  const { ctx: pen, bbox } = u;
  const to = (a, b) => [u.valToPos(a, "x", true), u.valToPos(b, "y", true)];
  const path = (count, at, close) => {
    pen.beginPath();
    let before = null;  // the last point drawn; others as close as these two are not
    for (let i = 0; i < count; i++) {
      const [a, b] = at(i);
      if (!Number.isFinite(a) || !Number.isFinite(b)) { before = null; continue; }
      const [x, y] = to(a, b);
      if (before === null) pen.moveTo(x, y);
      else if (Math.hypot(x - before[0], y - before[1]) > SEEN || i === count - 1) pen.lineTo(x, y);
      else continue;
      before = [x, y];
    }
    if (close) pen.closePath();
  };
  pen.save();
  pen.beginPath();
  pen.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  pen.clip();
  pen.lineJoin = "round";
  limits.forEach(({ points }, k) => {
    if (points.length === 2) return;
    path(points.length / 2, (i) => [points[2 * i], points[2 * i + 1]], true);
    pen.strokeStyle = pen.fillStyle = paletteColour(k + 1);
    pen.globalAlpha = 0.07;
    pen.fill();
    pen.globalAlpha = 1;
    pen.lineWidth = 1.5 * devicePixelRatio;
    pen.setLineDash([6 * devicePixelRatio, 3 * devicePixelRatio]);
    pen.stroke();
  });
  pen.setLineDash([]);
  path(x.length, (i) => [x[i], y[i]], false);
  pen.strokeStyle = paletteColour(0);
  pen.lineWidth = 1.5 * devicePixelRatio;
  pen.stroke();
  limits.forEach(({ points }, k) => { // one point is a diamond
    if (points.length !== 2) return;
    const [a, b] = to(points[0], points[1]);
    const half = 5 * devicePixelRatio;
    pen.beginPath();
    for (const [dx, dy] of [[half, 0], [0, half], [-half, 0], [0, -half]]) pen.lineTo(a + dx, b + dy);
    pen.closePath();
    pen.fillStyle = paletteColour(k + 1);
    pen.fill();
  });
  pen.restore();
}
