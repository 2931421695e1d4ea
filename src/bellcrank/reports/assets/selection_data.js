// ---- the data of the selection: what selection_data.py wrote, with names in place of numbers

/** The efficiency of a gear at an output torque, interpolated; constant beyond the ends of the curve. */
function efficiencyAt([loads, efficiencies], load) {
  if (load <= loads[0]) return efficiencies[0];
  const k = loads.findIndex((each) => each >= load);
  if (k < 0) return efficiencies.at(-1);
  const part = (load - loads[k - 1]) / (loads[k] - loads[k - 1]);
  return efficiencies[k - 1] + part * (efficiencies[k] - efficiencies[k - 1]);
}

/**
 * Speed and torque at the motor's shaft along samples of the axis: T = τ / (N η) where the motor drives the load,
 * T = τ η' / N where the load drives the motor, plus the inertia of rotor and gear times N q̈.
 */
function shaftLoad({ speed, torque, acceleration }, { ratio, efficiency, backEfficiency, efficiencyCurve, inertia, safety }) {
  return {
    speed: speed.map((w) => ratio * w),
    torque: torque.map((t, i) => {
      const load = safety * t;
      const drives = load * speed[i] >= 0;
      const eta = efficiencyCurve ? efficiencyAt(efficiencyCurve, Math.abs(load)) : drives ? efficiency : backEfficiency;
      return (drives ? load / (ratio * eta) : load * eta / ratio) + safety * inertia * ratio * acceleration[i];
    }),
  };
}

/** The selection; each candidate has its motor, gear and criteria, and `detail()` computes what its plots show. */
async function readSelection() {
  const data = JSON.parse(new TextDecoder().decode(await window.bellcrank.inflated("selection")));
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
    lossless: shaft.lossless,
    curves: motor.curves,
    temperatureLimits: motor.limits,
    temperatureText,
    cycles: axis.cycles.map((load, k) => ({ name: load.name, ...shaftLoad(load, shaft), ...cycles[k] })),
  };
}
