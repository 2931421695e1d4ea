// ---- the data of the selection: what selection_data.py wrote, with names in place of numbers

const STANDSTILL = 1e-6;  // rad/s of the shaft: slower is at rest

/** The value of a curve, interpolated; constant beyond its ends. */
function valueOnCurve([xs, ys], x) {
  if (x <= xs[0]) return ys[0];
  const k = xs.findIndex((each) => each >= x);
  if (k < 0) return ys.at(-1);
  return ys[k - 1] + (x - xs[k - 1]) / (xs[k] - xs[k - 1]) * (ys[k] - ys[k - 1]);
}

/**
 * Speed and torque at the motor's shaft along samples of the axis, as in actuators/powertrain.py: the torque of the load
 * and, opposed to the motion, of the gear's loss, over N; and the inertia of rotor and gear times N q̈.
 */
function shaftLoad({ speed, torque, acceleration }, { ratio, efficiency, backEfficiency, efficiencyCurve, inertia, safety }) {
  const least = efficiencyCurve ? efficiencyCurve[0][0] : 0;  // below it the loss is constant
  const shaftTorque = (load, w, a) => {
    const rests = Math.abs(w) * ratio <= STANDSTILL;
    const drives = rests || load * w >= 0;
    const size = Math.max(Math.abs(load), least);
    const eta = efficiencyCurve ? valueOnCurve(efficiencyCurve, size) : efficiency;
    const loss = size * (drives ? 1 / eta - 1 : 1 - (backEfficiency ?? eta));
    return (load + Math.sign(rests ? load : w) * loss) / ratio + inertia * ratio * a;
  };
  return {
    speed: speed.map((w) => ratio * w),
    torque: torque.map((t, i) => safety * shaftTorque(t, speed[i], acceleration[i])),
  };
}

/** The selection; each candidate has its motor, gear and criteria, and `detail()` computes what its plots show. */
async function readSelection(id = "selection") {
  const data = JSON.parse(new TextDecoder().decode(await window.bellcrank.inflated(id)));
  const criterion = ([name, use, verdict, text]) => ({ name: data.names[name], use, verdict: data.verdicts[verdict], text: data.texts[text] });
  for (const [number, axis] of data.axes.entries()) {
    axis.number = number;
    axis.candidates.forEach((candidate, rank) => {
      const [motor, gear] = [data.motors[candidate.motor], data.gears[candidate.gear]];
      Object.assign(candidate, {
        axis, rank, motor, gear,
        tier: data.tiers[candidate.tier],
        criteria: candidate.criteria.map(criterion),
        name: gear.direct ? motor.title : `${motor.title} + ${gear.title}`,
        detail: () => pairDetail(axis, candidate),
      });
    });
  }
  data.system = data.system.map(criterion);
  return data;
}

function pairDetail(axis, { motor, name, shaft, cycles, temperatureText }) {
  return {
    name,
    linear: axis.kind === "linear" && shaft.ratio === 1,
    leftOut: shaft.ratio === null ? ["ratio"] : shaft.leftOut,
    curves: motor.curves,
    unknownLimits: motor.unknown,
    temperatureLimits: motor.limits,
    temperatureText,
    cycles: shaft.ratio === null ? [] : axis.cycles.map((load, k) => ({ name: load.name, ...shaftLoad(load, shaft), ...cycles[k] })),
  };
}
