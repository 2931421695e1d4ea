// ---- one motor and gear: figures, torque-speed plane, utilisations and temperature

const SIGNS = { "all criteria shown": "●", "passes what is known": "◐", fails: "✕" };
const tierBadge = (tier) => element("span", { className: `tier ${tier.replaceAll(" ", "-")}` },
  element("i", { ariaHidden: "true", textContent: SIGNS[tier] }), element("span", { textContent: tier }));

const LONG = 40; // characters of a figure that takes a line of its own
const known = (value, unit, digits = 3) => (value === null || value === undefined ? "unknown" : `${formatNumber(value, digits)}${unit && ` ${unit}`}`);

/** A text as one word of a shell. */
const quoted = (text) => (/^[\w.=+-]+$/.test(text) ? text : `'${text.replaceAll("'", `'"'"'`)}'`);

/** (name, value) of a pair's figures. */
const pairFigures = (candidate) => [
  ["ratio", candidate.gear.direct ? "direct" : known(candidate.shaft.ratio, candidate.axis.kind === "linear" ? "rad/m" : "", 4)],
  ["largest utilisation", percent(candidate.use)],
  ["binding criterion", candidate.binding],
  ["mass", known(candidate.mass, "kg")],
  ["cost", known(candidate.cost, candidate.motor.currency)],
  ["electrical loss", known(candidate.loss, "W")],
  ["fit", candidate.fit],
];

/** (name, value): where a pair's figures are from, and how it is chosen. */
const pairOrigins = (candidate) => [
  ["figures of the motor", candidate.motor.origin],
  ...(candidate.gear.direct ? [] : [["figures of the gear", candidate.gear.origin]]),
  ["to choose it", `bellcrank select … --keep ${quoted(`${candidate.axis.name}=${[candidate.motor.id, ...(candidate.gear.direct ? [] : [candidate.gear.id])].join("+")}`)}`],
];

/** The whole view of a pair; `open` shows the sentence of every criterion, as print needs it, `of` says whose it is. */
function pairView(candidate, width, { open = false, figures = true, reach = null, of = "" } = {}) {
  const detail = candidate.detail();
  const box = element("article", { className: "pair" },
    element("header", {}, element("h3", { textContent: of ? `${of}: ${candidate.name}` : candidate.name }), tierBadge(candidate.tier)));
  if (figures) {
    box.append(element("dl", { className: "figures" },
      ...[...pairFigures(candidate), ...pairOrigins(candidate)].map(([name, value]) => element("div", { className: value.length > LONG ? "long" : "" }, element("dt", { textContent: name }), element("dd", { textContent: value })))));
  }
  box.append(torqueSpeedPlane(detail, width, reach ?? planeReach(detail)),
    element("section", { className: "use-part" }, element("h4", { textContent: "Utilisation, 100 % at the limit; press a bar for its load and limit" }), useBars(candidate.criteria, open)),
    element("section", { className: "temperature-part" }, element("h4", { textContent: "Temperature" }), temperatureChart(detail, width)));
  return box;
}
