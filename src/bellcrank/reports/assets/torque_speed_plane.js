// ---- the torque-speed plane of a motor: the load of its cycles, and what the motor can do

const RPM = 30 / Math.PI;
const BEYOND = 4;  // times the largest load: what reaches further is cut off

/**
 * Loads are folded to positive speeds, which changes no limit: all limits are the same for the opposite torque and
 * speed together. So a positive torque drives, and a negative one brakes.
 */
function foldedLoad({ speed, torque }, { speedScale }) {
  return speed.map((w, i) => [Math.abs(w) * speedScale, w === 0 ? Math.abs(torque[i]) : torque[i] * Math.sign(w)]);
}

/** Units of the plane: a rotary shaft in rpm and N m, or a linear actuator in m/s and N. */
const planeUnits = (linear) => (linear ? { speedScale: 1, speed: "m/s", torque: "N", quantity: "force", of: "rod" }
  : { speedScale: RPM, speed: "rpm", torque: "N m", quantity: "torque", of: "motor" });

/** The outline of the short-time region; where no bound is known it reaches the frame of the plot. */
function regionOutline([speeds, lows, highs], [fast, strong], speedScale) {
  const upper = speeds.map((w, i) => [w === null ? fast : w * speedScale, highs[i] ?? 2 * strong]);
  const lower = speeds.map((w, i) => [w === null ? fast : w * speedScale, lows[i] ?? -2 * strong]);
  return [...upper, ...lower.reverse()];
}

/** The speed and torque up to which a plane shows a pair, in its units. */
function planeReach({ cycles, curves: { continuous, region }, unknownLimits, linear }) {
  const { speedScale } = planeUnits(linear);
  const largest = (values) => values.reduce((most, v) => Math.max(most, Math.abs(v ?? 0)), 0);
  const upTo = (load, limit) => Math.max(load, load > 0 ? Math.min(limit, BEYOND * load) : limit) || 1;
  const speeds = [cycles.flatMap(({ speed }) => speed), [...continuous?.[0] ?? [], ...region?.[0] ?? []]];
  const torques = [cycles.flatMap(({ torque, rmsTorque }) => [...torque, rmsTorque]), [...continuous?.[1] ?? [],
    ...unknownLimits.includes("peak torque") ? [] : region?.[2] ?? []]];
  return [upTo(...speeds.map(largest)) * speedScale * 1.06, upTo(...torques.map(largest)) * 1.08];
}

/** The plane of a pair; `reach` is that of `planeReach`, or larger. */
function torqueSpeedPlane({ cycles, curves, unknownLimits, linear, leftOut, name }, width, [fast, strong]) {
  const units = planeUnits(linear);
  const scaled = (curve) => curve && curve[0].map((w, i) => [w * units.speedScale, curve[1][i]]);
  const [continuous, voltage] = [scaled(curves.continuous), scaled(curves.voltage)];
  const { region } = curves;
  const loads = cycles.map((cycle) => foldedLoad(cycle, units));
  const rms = cycles.map(({ meanSpeed, rmsTorque }) => [meanSpeed * units.speedScale, rmsTorque]);
  const brakes = loads.flat().some(([, torque]) => torque < 0);
  const plot = makeSvgPlot({
    width,
    height: Math.round(Math.min(Math.max(0.62 * width, 230), 360)),
    x: { label: `${units.of} speed [${units.speed}]`, range: [0, fast] },
    y: { label: `${units.of} ${units.quantity} [${units.torque}]`, range: [brakes ? -strong : 0, strong] },
    title: `torque-speed plane of ${name}`,
  });
  if (region) plot.line(regionOutline(region, [fast, strong], units.speedScale), "region", true);
  if (voltage) plot.line(voltage, "voltage");
  if (continuous) {
    plot.line(continuous, "continuous");
    plot.line(continuous.map(([speed, torque]) => [speed, -torque]), "continuous");
  }
  loads.forEach((points, k) => plot.dots(points, `dots cycle-${k % 6}`));
  rms.forEach((point, k) => plot.diamond(point, `diamond cycle-${k % 6}`));
  const rmsText = ({ rmsTorque, meanSpeed }) => `RMS ${formatNumber(rmsTorque, 3)} ${units.torque} at mean speed ${formatNumber(meanSpeed * units.speedScale, 3)} ${units.speed}`;
  const legend = plotLegend([
    ...cycles.flatMap((cycle, k) => [[`dots cycle-${k % 6}`, `load, ${cycle.name}`],
      ...cycle.rmsTorque === null ? [] : [[`diamond cycle-${k % 6}`, rmsText(cycle)]]]),
    ...continuous ? [["continuous", "S1 (continuous)"]] : [],
    ...region ? [["region", `short-time region${unknownLimits.length ? ", as far as known" : ""}`]] : [],
    ...voltage ? [["voltage", "voltage limit"]] : [],
  ]);
  const missing = [...continuous ? [] : ["S1 curve"], ...unknownLimits];
  const notes = [
    ...missing.length ? [`Not stated: ${missing.join(", ")}.`] : [],
    ...leftOut.length ? [`Not stated and left out of the load: ${leftOut.join(", ")}.`] : [],
    ...brakes ? ["Negative torque: the load drives the motor."] : [],
  ];
  return element("figure", { className: "plane" }, plot.root, legend, element("figcaption", { textContent: notes.join(" ") }));
}
