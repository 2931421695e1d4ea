// ---- plots as SVG: axes with units, and marks; text keeps its size, and print is sharp

const MARGIN = { left: 58, right: 14, top: 10, bottom: 44 };

/** A new SVG element; text is never parsed as markup. */
function svg(tag, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

/** Round numbers that cover a range, about `count` of them. */
function roundTicks([low, high], count) {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((factor) => factor * power >= rough * 0.999) * power;
  const first = Math.ceil(low / step - 1e-9);
  const last = Math.floor(high / step + 1e-9);
  return Array.from({ length: last - first + 1 }, (_, k) => (first + k) * step);
}

const tickLabel = (value) => formatNumber(Math.abs(value) < 1e-12 ? 0 : value, 6);

/** The range of finite values with a share of it as margin; `around` are values that it includes. */
function rangeOf(values, around = [], margin = 0.06) {
  let [low, high] = [Infinity, -Infinity];
  for (const v of [...around, ...values]) {
    if (!Number.isFinite(v)) continue;
    low = Math.min(low, v);
    high = Math.max(high, v);
  }
  if (low > high) return [0, 1];
  const space = margin * (high - low || Math.abs(high) || 1);
  return [low === 0 ? 0 : low - space, high === 0 ? 0 : high + space];
}

/** A plot with axes; `x` and `y` are {label, range, last tick}. It draws lines and marks in the units of its axes. */
function makeSvgPlot({ width, height, x, y, title }) {
  const { left, right, top, bottom } = MARGIN;
  const inner = { width: width - left - right, height: height - top - bottom };
  const toX = (value) => left + (value - x.range[0]) / (x.range[1] - x.range[0]) * inner.width;
  const toY = (value) => top + (y.range[1] - value) / (y.range[1] - y.range[0]) * inner.height;
  const root = svg("svg", { viewBox: `0 0 ${width} ${height}`, width, height, class: "svg-plot", role: "img", "aria-label": title });
  const clip = `clip-${makeSvgPlot.count = (makeSvgPlot.count ?? 0) + 1}`;
  const area = svg("g", { "clip-path": `url(#${clip})` });
  root.append(svg("defs", {}, svg("clipPath", { id: clip }, svg("rect", { x: left, y: top, ...inner }))),
    svg("rect", { x: left, y: top, ...inner, class: "frame" }));
  for (const value of roundTicks(x.range, inner.width / 75).filter((tick) => tick <= (x.last ?? Infinity))) {
    root.append(svg("line", { x1: toX(value), x2: toX(value), y1: top, y2: top + inner.height, class: "grid" }),
      svg("text", { x: toX(value), y: height - bottom + 16, class: "tick", "text-anchor": "middle" }, tickLabel(value)));
  }
  for (const value of roundTicks(y.range, inner.height / 36)) {
    root.append(svg("line", { x1: left, x2: left + inner.width, y1: toY(value), y2: toY(value), class: value === 0 ? "grid zero" : "grid" }),
      svg("text", { x: left - 7, y: toY(value) + 4, class: "tick", "text-anchor": "end" }, tickLabel(value)));
  }
  const middle = top + inner.height / 2;
  root.append(svg("text", { x: left + inner.width / 2, y: height - 8, class: "axis", "text-anchor": "middle" }, x.label),
    svg("text", { x: 14, y: middle, class: "axis", "text-anchor": "middle", transform: `rotate(-90 14 ${middle})` }, y.label), area);
  const path = (points, close) => {
    let text = "";
    let pen = "M";
    for (const [a, b] of points) {
      if (Number.isFinite(a) && Number.isFinite(b)) text += `${pen}${toX(a).toFixed(1)} ${toY(b).toFixed(1)}`;
      pen = Number.isFinite(a) && Number.isFinite(b) ? "L" : "M";
    }
    return text && close ? `${text}Z` : text;
  };
  return {
    root,
    toX,
    toY,
    /** A text in place of a tick below the x axis. */
    under(value, text) {
      root.append(svg("text", { x: toX(value), y: height - bottom + 16, class: "tick", "text-anchor": "middle" }, text));
    },
    across: (value) => x.range.map((end) => [end, value]),
    upright: (value) => y.range.map((end) => [value, end]),
    /** A line through points, interrupted where they are not finite; `close` makes it an outline. */
    line(points, name, close = false) {
      const drawn = svg("path", { d: path(points, close), class: name });
      area.append(drawn);
      return drawn;
    },
    /** Small dots, as one path. */
    dots(points, name, radius = 1.7) {
      let text = "";
      for (const [a, b] of points) {
        if (Number.isFinite(a) && Number.isFinite(b)) {
          text += `M${(toX(a) - radius).toFixed(1)} ${toY(b).toFixed(1)}a${radius} ${radius} 0 1 0 ${2 * radius} 0a${radius} ${radius} 0 1 0 ${-2 * radius} 0`;
        }
      }
      area.append(svg("path", { d: text, class: name }));
    },
    /** A diamond. */
    diamond([a, b], name, half = 6) {
      if (!(Number.isFinite(a) && Number.isFinite(b))) return;
      const [px, py] = [toX(a), toY(b)];
      area.append(svg("path", { d: `M${px - half} ${py}L${px} ${py - half}L${px + half} ${py}L${px} ${py + half}Z`, class: name }));
    },
    /** A text above a point, or below it near the upper edge. */
    note([a, b], text, anchor = "end") {
      const [x, y] = [toX(a) + (anchor === "end" ? -5 : 5), toY(b)];
      area.append(svg("text", { x, y: y < top + 18 ? y + 14 : y - 5, class: "label", "text-anchor": anchor }, text));
    },
  };
}

/** The message in place of a plot that nothing is known of. */
const nothingToPlot = (text) => element("p", { className: "nothing", textContent: text });

/** A legend: names with their swatches, whose class is that of the mark. */
function plotLegend(entries) {
  return element("ul", { className: "plot-legend" }, ...entries.map(([name, text]) => {
    const swatch = svg("svg", { viewBox: "0 0 22 12", width: 22, height: 12, "aria-hidden": "true" });
    const mark = name.startsWith("dots") ? svg("circle", { cx: 11, cy: 6, r: 3, class: name })
      : name.startsWith("diamond") ? svg("path", { d: "M5 6L11 0L17 6L11 12Z", class: name })
      : name.startsWith("region") ? svg("rect", { x: 1, y: 1, width: 20, height: 10, class: name })
      : svg("path", { d: "M0 6L22 6", class: name });
    swatch.append(mark);
    return element("li", {}, swatch, element("span", { textContent: text }));
  }));
}
