// ---- the Pareto picture: mass against largest utilisation, coloured by loss

const LOSS_COLOURS = ["#0072B2", "#4aa3c7", "#a6b58c", "#e6a33d", "#b83b00"];  // from little to much

/** A colour between LOSS_COLOURS, for a part from 0 to 1. */
function lossColour(part) {
  const place = Math.min(Math.max(part, 0), 1) * (LOSS_COLOURS.length - 1);
  const k = Math.min(Math.floor(place), LOSS_COLOURS.length - 2);
  return `color-mix(in srgb, ${LOSS_COLOURS[k]}, ${LOSS_COLOURS[k + 1]} ${Math.round(100 * (place - k))}%)`;
}

function paretoChart({ pareto, axes }, width) {
  if (!pareto.length) return nothingToPlot("No combination of pairs passes, so there is no Pareto picture.");
  const masses = pareto.map(({ mass }) => mass).filter((mass) => mass !== null);
  const losses = pareto.map(({ loss }) => loss).filter((loss) => loss !== null);
  const [least, most] = [Math.min(...losses), Math.max(...losses)];
  const range = rangeOf(masses, [], 0.1);
  const unknownMass = masses.length < pareto.length;
  const beside = range[1] + 0.06 * (range[1] - range[0]);  // where combinations of unknown mass stand
  const plot = makeSvgPlot({
    width,
    height: Math.round(Math.min(Math.max(0.55 * width, 240), 380)),
    x: { label: "mass of all motors and gears [kg]", range: unknownMass ? [range[0], range[1] + 0.12 * (range[1] - range[0])] : range },
    y: { label: "largest utilisation [%]", range: rangeOf(pareto.map(({ use }) => 100 * use), [100], 0.1) },
    title: "Pareto picture: mass against largest utilisation",
  });
  plot.line(plot.across(100), "limit");
  plot.note([range[0], 100], "limit", "start");
  if (unknownMass) {
    plot.line(plot.upright(range[1]), "divider");
  }
  const told = element("div", { className: "combination", ariaLive: "polite" });
  const marks = pareto.map((combination, k) => {
    const { mass, use, loss, chosen } = combination;
    const [x, y] = [plot.toX(mass ?? beside), plot.toY(100 * use)];
    const spot = svg("circle", { cx: x, cy: y, r: 7, class: loss === null ? "spot unknown" : "spot" });
    if (loss !== null) spot.style.fill = lossColour(most > least ? (loss - least) / (most - least) : 0.5);
    const mark = svg("g", { class: chosen ? "combination-mark chosen" : "combination-mark", tabindex: k === 0 ? 0 : -1, role: "button",
      "aria-label": combinationText(combination) }, svg("circle", { cx: x, cy: y, r: 15, class: "touch" }), spot);
    if (chosen) mark.append(svg("circle", { cx: x, cy: y, r: 11, class: "ring" }));
    return mark;
  });
  const tell = (k) => {
    marks.forEach((mark, i) => {
      mark.classList.toggle("current", i === k);
      mark.setAttribute("tabindex", i === k ? 0 : -1);
    });
    const { pairs, chosen } = pareto[k];
    told.replaceChildren(element("p", { textContent: `${combinationText(pareto[k])}${chosen ? " – the choice" : ""}` }),
      element("dl", {}, ...pairs.map((pair, i) => element("div", {}, element("dt", { textContent: axes[i]?.name ?? "" }), element("dd", { textContent: pair })))));
  };
  marks.forEach((mark, k) => {
    for (const kind of ["pointerenter", "focus", "click"]) mark.addEventListener(kind, () => tell(k));
    mark.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
      if (!step) return;
      event.preventDefault();
      event.stopPropagation();
      marks[(k + step + marks.length) % marks.length].focus();
    });
  });
  plot.root.append(...marks);
  plot.root.setAttribute("role", "group");
  const start = pareto.findIndex(({ chosen }) => chosen);
  tell(Math.max(start, 0));
  const legend = element("div", { className: "loss-legend" });
  if (losses.length) {
    const bar = element("i", {});
    bar.style.background = `linear-gradient(to right, ${LOSS_COLOURS.join(", ")})`;
    legend.append(element("span", { textContent: `loss ${formatNumber(least, 3)} W` }), bar, element("span", { textContent: `${formatNumber(most, 3)} W` }));
  }
  if (losses.length < pareto.length) legend.append(element("span", { textContent: "hollow: loss unknown" }));
  if (unknownMass) legend.append(element("span", { textContent: "right of the divider: mass unknown" }));
  if (start >= 0) legend.append(element("span", { textContent: "ring: the choice" }));
  return element("figure", { className: "pareto" }, plot.root, legend, told);
}

const combinationText = ({ mass, use, loss }) => `mass ${known(mass, "kg")}, largest utilisation ${percent(use)}, loss ${known(loss, "W")}`;
