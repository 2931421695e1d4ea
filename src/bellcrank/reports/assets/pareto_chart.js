// ---- the Pareto picture: mass against largest utilisation, coloured by loss

const LOSS_COLOURS = ["#0072B2", "#4aa3c7", "#a6b58c", "#e6a33d", "#b83b00"];  // from little to much

/** A colour between LOSS_COLOURS, for a part from 0 to 1. */
function lossColour(part) {
  const place = Math.min(Math.max(part, 0), 1) * (LOSS_COLOURS.length - 1);
  const k = Math.min(Math.floor(place), LOSS_COLOURS.length - 2);
  return `color-mix(in srgb, ${LOSS_COLOURS[k]}, ${LOSS_COLOURS[k + 1]} ${Math.round(100 * (place - k))}%)`;
}

const MANY_MARKS = 60;
const NEAR = 26;  // px from the pointer to the mark that it means

function paretoPlot({ masses, pareto }, width) {
  const range = rangeOf(masses, [], 0.1);
  const unknownMass = masses.length < pareto.length;
  const span = range[1] - range[0];
  const plot = makeSvgPlot({
    width,
    height: Math.round(Math.min(Math.max(0.55 * width, 240), 380)),
    x: { label: "mass of all motors and gears [kg]", range: unknownMass ? [range[0], range[1] + 0.14 * span] : range, last: range[1] },
    y: { label: "largest utilisation [%]", range: rangeOf(pareto.map(({ use }) => 100 * use), [100], 0.1) },
    title: "Pareto picture: mass against largest utilisation",
  });
  plot.line(plot.across(100), "limit");
  plot.note([range[0], 100], "limit", "start");
  if (unknownMass) {
    plot.line(plot.upright(range[1]), "divider");
    plot.under(range[1] + 0.07 * span, "unknown");
  }
  return { plot, place: ({ mass, use }) => [plot.toX(mass ?? range[1] + 0.07 * span), plot.toY(100 * use)] };
}

/** The mark of a combination, coloured by its loss. */
function paretoMark(combination, [x, y], radius, [least, most]) {
  const { loss, chosen } = combination;
  const spot = svg("circle", { cx: x, cy: y, r: radius, class: loss === null ? "spot unknown" : "spot" });
  if (loss !== null) spot.style.fill = lossColour(most > least ? (loss - least) / (most - least) : 0.5);
  const mark = svg("g", { class: chosen ? "combination-mark chosen" : "combination-mark", tabindex: -1, role: "button",
    "aria-label": combinationText(combination) }, spot);
  if (chosen) mark.append(svg("circle", { cx: x, cy: y, r: radius + 4, class: "ring" }));
  mark.append(svg("circle", { cx: x, cy: y, r: radius + 7, class: "current-ring" }));
  return mark;
}

function paretoLegend({ pareto, losses, masses }) {
  const legend = element("div", { className: "loss-legend" });
  if (losses.length) {
    const bar = element("i", {});
    bar.style.background = `linear-gradient(to right, ${LOSS_COLOURS.join(", ")})`;
    legend.append(element("span", { textContent: `loss ${formatNumber(Math.min(...losses), 3)} W` }), bar,
      element("span", { textContent: `${formatNumber(Math.max(...losses), 3)} W` }));
  }
  const notes = [["hollow: loss unknown", losses.length < pareto.length], ["right of the divider: mass unknown", masses.length < pareto.length],
    ["ring: the choice", pareto.some(({ chosen }) => chosen)]];
  legend.append(...notes.filter(([, holds]) => holds).map(([text]) => element("span", { textContent: text })));
  return legend;
}

function paretoChart({ pareto, axes }, width) {
  if (!pareto.length) return nothingToPlot("No combination of pairs passes, so there is no Pareto picture.");
  const stated = (name) => pareto.map((combination) => combination[name]).filter((value) => value !== null);
  const [masses, losses] = [stated("mass"), stated("loss")];
  const { plot, place } = paretoPlot({ masses, pareto }, width);
  const places = pareto.map(place);
  const radius = pareto.length > MANY_MARKS ? 4 : 7;
  const marks = pareto.map((combination, k) => paretoMark(combination, places[k], radius, [Math.min(...losses), Math.max(...losses)]));
  const told = element("div", { className: "combination", ariaLive: "polite" });
  const tell = (k) => {
    marks.forEach((mark, i) => {
      mark.classList.toggle("current", i === k);
      mark.setAttribute("tabindex", i === k ? 0 : -1);
    });
    const { pairs, chosen } = pareto[k];
    told.replaceChildren(element("p", { textContent: `${combinationText(pareto[k])}${chosen ? " – the choice" : ""}` }),
      element("dl", {}, ...pairs.map((pair, i) => element("div", {}, element("dt", { textContent: axes[i]?.name ?? "" }), element("dd", { textContent: pair })))));
  };
  const tellNearest = ({ clientX, clientY }) => {
    const { left, top, width: drawn } = plot.root.getBoundingClientRect();
    const scale = drawn / width;
    const off = places.map(([x, y]) => Math.hypot(left + x * scale - clientX, top + y * scale - clientY));
    const nearest = off.indexOf(Math.min(...off));
    if (off[nearest] < NEAR) tell(nearest);
  };
  plot.root.addEventListener("pointermove", (event) => { if (event.pointerType === "mouse") tellNearest(event); });
  plot.root.addEventListener("click", tellNearest);
  const order = places.map((_, k) => k).sort((a, b) => places[a][0] - places[b][0] || places[a][1] - places[b][1]);
  marks.forEach((mark, k) => {
    mark.addEventListener("focus", () => tell(k));
    mark.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
      if (!step) return;
      event.preventDefault();
      event.stopPropagation();
      marks[order[(order.indexOf(k) + step + order.length) % order.length]].focus();
    });
  });
  plot.root.append(...marks.filter((_, k) => !pareto[k].chosen), ...marks.filter((_, k) => pareto[k].chosen));
  plot.root.setAttribute("role", "group");
  tell(Math.max(pareto.findIndex(({ chosen }) => chosen), 0));
  return element("figure", { className: "pareto" }, plot.root, paretoLegend({ pareto, losses, masses }), told);
}

const combinationText = ({ mass, use, loss, cost }) => [`mass ${known(mass, "kg")}`, `largest utilisation ${percent(use)}`,
  `loss ${known(loss, "W")}`, ...cost === null ? [] : [`cost ${formatNumber(cost, 4)}`]].join(", ");
