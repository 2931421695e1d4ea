// ---- the map of a study: designs as dots over two quantities, coloured by a third

const MAP_COLOURS = ["#440154", "#3b528b", "#21918c", "#5ec962", "#fde725"];  // viridis: S. van der Walt, N. Smith (2015)
const COLOUR_STEPS = 32;
const CLOSE = 9;  // px from the pointer to a design that failed
const [SMALL_DOT, LARGE_DOT] = [1.9, 3.9];  // px: a design of which only numbers are in the page, and one that can move

/** A colour of the map, for a part from 0 to 1. */
function mapColour(part) {
  const place = Math.min(Math.max(part, 0), 1) * (MAP_COLOURS.length - 1);
  const k = Math.min(Math.floor(place), MAP_COLOURS.length - 2);
  return `color-mix(in srgb, ${MAP_COLOURS[k]}, ${MAP_COLOURS[k + 1]} ${Math.round(100 * (place - k))}%)`;
}

const columnLabel = ({ name, unit }) => `${name} [${formatUnit(unit)}]`;

/** The least and the largest finite value; null where there is none. */
function extremes(values) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    if (!Number.isFinite(value)) continue;
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  return low > high ? null : [low, high];
}

/** The outlines of dots as one path. */
function dotPath(places, radius) {
  return places.map(([x, y]) => `M${(x - radius).toFixed(1)} ${y.toFixed(1)}a${radius} ${radius} 0 1 0 ${2 * radius} 0a${radius} ${radius} 0 1 0 ${-2 * radius} 0`).join("");
}

const crossPath = (places) => places.map(([x, y]) => `M${(x - 3).toFixed(1)} ${(y - 3).toFixed(1)}l6 6m-6 0l6 -6`).join("");

/**
 * A map in `width` px. `x`, `y` and `colour` are columns {name, unit, values}; `shown` the rows that can move; `pick` is
 * called with the row that a click means. Returns its box, `mark`, which rings a row or none, and `pixel`.
 */
function makeDesignMap({ x, y, colour, limits, shown, width, pick }) {
  const plot = makeSvgPlot({
    width,
    height: Math.round(Math.min(Math.max(0.72 * width, 240), 420)),
    x: { label: columnLabel(x), range: rangeOf(x.values) },
    y: { label: columnLabel(y), range: rangeOf(y.values) },
    title: `Map of the designs: ${y.name} over ${x.name}`,
  });
  const bottom = plot.toY(rangeOf(y.values)[0]) - 4;
  const left = plot.toX(rangeOf(x.values)[0]) + 4;
  const places = Array.from(x.values, (value, row) => [Number.isFinite(value) ? plot.toX(value) : left,
    Number.isFinite(y.values[row]) ? plot.toY(y.values[row]) : bottom]);
  for (const { measure, value } of limits) {
    if (measure === x.name) plot.line(plot.upright(value), "limit");
    if (measure === y.name) plot.line(plot.across(value), "limit");
  }
  const range = extremes(colour.values);
  const there = (row) => [x, y, colour].every(({ values }) => Number.isFinite(values[row]));
  const step = (row) => (range[1] > range[0] ? Math.round((colour.values[row] - range[0]) / (range[1] - range[0]) * COLOUR_STEPS) : COLOUR_STEPS / 2);
  const movable = new Set(shown);
  const layers = [new Map(), new Map()];  // of small dots, of large ones: rows by colour
  const absent = [];
  for (let row = 0; row < places.length; row++) {
    if (!there(row)) { absent.push(row); continue; }
    const layer = layers[Number(movable.has(row))];
    const key = step(row);
    if (!layer.has(key)) layer.set(key, []);
    layer.get(key).push(row);
  }
  plot.root.append(svg("path", { d: crossPath(absent.map((row) => places[row])), class: "absent" }));
  layers.forEach((layer, large) => {
    for (const [key, rows] of layer) {
      const drawn = svg("path", { d: dotPath(rows.map((row) => places[row]), large ? LARGE_DOT : SMALL_DOT), class: large ? "design can-move" : "design" });
      drawn.style.fill = mapColour(key / COLOUR_STEPS);
      plot.root.append(drawn);
    }
  });
  const ring = svg("circle", { r: 8, class: "current-design", visibility: "hidden" });
  plot.root.append(ring);
  plot.root.addEventListener("click", (event) => {
    const box = plot.root.getBoundingClientRect();
    const scale = width / box.width;
    const at = [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
    const distance = (row) => Math.hypot(places[row][0] - at[0], places[row][1] - at[1]);
    const nearest = (rows) => rows.reduce((best, row) => (best === null || distance(row) < distance(best) ? row : best), null);
    const failed = nearest(absent.filter((row) => !movable.has(row)));
    const moving = nearest(shown);
    const row = failed !== null && distance(failed) < CLOSE && (moving === null || distance(failed) < distance(moving)) ? failed : moving;
    if (row !== null) pick(row);
  });
  const legend = element("div", { className: "colour-legend" });
  if (range) {
    const bar = element("i", {});
    bar.style.background = `linear-gradient(to right, ${MAP_COLOURS.join(", ")})`;
    legend.append(element("span", { textContent: `${columnLabel(colour)}: ${formatNumber(range[0], 5)}` }), bar,
      element("span", { textContent: formatNumber(range[1], 5) }));
  }
  if (absent.length) legend.append(element("span", { textContent: `× ${absent.length.toLocaleString("en")} designs without a value` }));
  return {
    box: element("figure", {}, plot.root, legend),
    /** Where a row is on the screen. */
    pixel(row) {
      const box = plot.root.getBoundingClientRect();
      return [box.left + places[row][0] * box.width / width, box.top + places[row][1] * box.width / width];
    },
    mark(row) {
      if (row === null) return ring.setAttribute("visibility", "hidden");
      ring.setAttribute("cx", places[row][0]);
      ring.setAttribute("cy", places[row][1]);
      ring.setAttribute("visibility", "visible");
    },
  };
}
