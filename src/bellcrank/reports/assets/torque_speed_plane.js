// ---- the torque-speed plane of a motor: the load of its cycles, and what the motor can do

const RPM = 30 / Math.PI;
const BEYOND = 5;  // times the largest load: what reaches further is cut off

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

function torqueSpeedPlane({ cycles, curves, linear, lossless, name }, width) {
  const units = planeUnits(linear);
  const scale = ([speed, torque]) => speed.map((w, i) => [w * units.speedScale, torque[i]]);
  const loads = cycles.map((cycle) => foldedLoad(cycle, units));
  const rms = cycles.map(({ meanSpeed, rmsTorque }) => [meanSpeed * units.speedScale, rmsTorque]);
  const lines = Object.fromEntries(Object.entries(curves).map(([key, curve]) => [key, curve && scale(curve)]));
  const limits = [lines.region, lines.continuous].filter(Boolean).flat();
  const reach = (k) => {
    const largest = Math.max(...[...loads.flat(), ...rms].map((point) => Math.abs(point[k])).filter(Number.isFinite), 0);
    const limit = Math.max(...limits.map((point) => Math.abs(point[k])).filter(Number.isFinite), 0);
    return Math.max(largest, largest > 0 ? Math.min(limit, BEYOND * largest) : limit) || 1;
  };
  const [fast, strong] = [reach(0) * 1.06, reach(1) * 1.08];
  const brakes = [...loads.flat(), ...limits].some(([, torque]) => torque < 0);
  const plot = makeSvgPlot({
    width,
    height: Math.round(Math.min(Math.max(0.62 * width, 230), 360)),
    x: { label: `${units.of} speed [${units.speed}]`, range: [0, fast] },
    y: { label: `${units.of} ${units.quantity} [${units.torque}]`, range: [brakes ? -strong : 0, strong] },
    title: `torque-speed plane of ${name}`,
  });
  if (lines.region) plot.line(lines.region, "region", true);
  if (lines.voltage) plot.line(lines.voltage, "voltage");
  if (lines.continuous) {
    plot.line(lines.continuous, "continuous");
    plot.line(lines.continuous.map(([speed, torque]) => [speed, -torque]), "continuous");
  }
  loads.forEach((points, k) => plot.dots(points, `dots cycle-${k % 6}`));
  rms.forEach((point, k) => plot.diamond(point, `diamond cycle-${k % 6}`));
  const entry = (cycle, k) => [[`dots cycle-${k % 6}`, `${lossless ? "load without the gear's losses" : "load"}, ${cycle.name}`],
    ...Number.isFinite(cycle.rmsTorque) ? [[`diamond cycle-${k % 6}`, `RMS ${formatNumber(cycle.rmsTorque, 3)} ${units.torque} at mean speed ${formatNumber(cycle.meanSpeed * units.speedScale, 3)} ${units.speed}`]] : []];
  const unknown = [["continuous", "S1 curve"], ["region", "short-time region"], ["voltage", "voltage line"]];
  const legend = plotLegend([
    ...cycles.flatMap(entry),
    ...unknown.filter(([key]) => lines[key]).map(([key, text]) => [key, text]),
  ]);
  const missing = unknown.filter(([key]) => !lines[key]).map(([, text]) => text);
  const notes = [
    ...missing.length ? [`Unknown: ${missing.join(", ")}.`] : [],
    ...lossless ? ["The gear's efficiency is unknown: driving takes more than these points show, braking less."] : [],
    ...brakes ? ["Negative: the load drives the motor."] : [],
  ];
  return element("figure", { className: "plane" }, plot.root, legend, element("figcaption", { textContent: notes.join(" ") }));
}
