// ---- a linkage whose lengths are changed: the joints that follow from others (sizing/live/live_motion.py has the step)

// As in dynamics/postures/loop_kinematics.py: where Newton's method ends, and the largest way from a posture to the next.
const [CLOSED, CLOSED_ROUNDED, LEAP, NEWTON_STEPS] = [1e-13, 1e-11, 0.1, 12];
const [LEAST_STEP, DEAD_POINT] = [2 ** -12, 1e-6];  // of the way between the values; a share of the size of J_d

/**
 * A function that puts positions of dependent joints into `closed`, for the place that the module `step` is called
 * for, and returns whether it found them. The parameters go from `stored` values to those that are set, so that the
 * posture stays on its branch; `moving` are those that move it.
 */
function makeClosing(step, { settings, between, closed, next, about, posture }, stored, moving) {
  const before = new Float64Array(closed.length);
  const newton = (sign) => {
    let strayed = 0;
    let last = Infinity;
    for (let k = 0; k < NEWTON_STEPS; k++) {
      step();
      const [residual, move, determinant, share] = about;
      if (!(Number.isFinite(residual + move) && determinant * sign > 0 && share > DEAD_POINT)) return false;
      if (residual <= CLOSED || (residual <= CLOSED_ROUNDED && residual >= last)) return true;
      last = residual;
      strayed += move;
      if (!(strayed <= LEAP)) return false;
      closed.set(next);
    }
    return false;
  };
  return () => {
    between.set(stored);
    step();
    closed.set(posture);
    if (moving.every((k) => settings[k] === stored[k])) return true;
    step();
    const sign = about[2];
    for (let [share, length] = [0, 1]; share < 1;) {
      before.set(closed);
      const wanted = Math.min(share + length, 1);
      for (const k of moving) between[k] = wanted === 1 ? settings[k] : stored[k] + wanted * (settings[k] - stored[k]);
      if (newton(sign)) {
        share = wanted;
        length *= 2;
        continue;
      }
      closed.set(before);
      length /= 2;
      if (length < LEAST_STEP) return false;
    }
    return true;
  };
}
