// ---- sums and largest values along a motion, whatever the quantities are, as sizing/motion_grid.py and sizing/maxima.py

const PARTS = 300;  // of a whole motion, at least
const NODES = [0.5 - Math.sqrt(0.15), 0.5, 0.5 + Math.sqrt(0.15)];  // of Gauss and Legendre's rule
const WEIGHTS = [5 / 18, 8 / 18, 5 / 18];
const [HALVINGS, SETTLED, LEAST_SUM] = [16, 1e-10, 1e-12];  // a part is halved until that changes no sum by this share of it
const MOST_SAMPLES = 200_000;
const [CANDIDATES, CLOSE, PROBES, NARROWINGS, ROUNDED] = [6, 0.02, 9, 13, 4e-16];  // local maxima that are refined

/** The means of rates, the largest sizes, and the samples in order of time. */
function alongMotion(functions, motion, factor) {
  const [shown, sizes, rates] = ["shown", "sizes", "rates"].map(functions.view);
  const samples = [];
  const keep = (piece, s) => samples.push({ piece, s, shown: shown.slice(), sizes: sizes.slice() });
  const at = (piece, s) => {
    functions.at(motion, piece, s, factor);
    keep(piece, s);
  };
  const sumOver = ({ piece, low, high }) => {
    const sum = new Float64Array(rates.length);
    NODES.forEach((node, k) => {
      at(piece, low + (high - low) * node);
      const weight = WEIGHTS[k] * (high - low) * motion.length[motion.pieces[piece].quintic];
      for (let j = 0; j < sum.length; j++) sum[j] += weight * rates[j];
    });
    return sum;
  };
  const total = new Float64Array(rates.length);
  const add = (to, sum) => { for (let j = 0; j < to.length; j++) to[j] += sum[j]; };

  let parts = [];
  for (let piece = 0; piece < motion.pieces.length; piece++) {
    const { quintic, low, high } = motion.pieces[piece];
    const count = Math.max(1, Math.ceil(PARTS * (high - low) * motion.length[quintic] / motion.duration - 1e-9));
    for (let k = 0; k < count; k++) {
      const part = { piece, low: low + (high - low) * k / count, high: low + (high - low) * (k + 1) / count };
      at(piece, part.low);
      if (k === count - 1) at(piece, part.high);
      parts.push({ ...part, sum: sumOver(part) });
    }
  }
  const whole = new Float64Array(rates.length);
  for (const { sum } of parts) add(whole, sum);
  const enough = whole.map((value) => SETTLED * Math.max(value, LEAST_SUM * Math.max(...whole) + 1e-300));
  for (let depth = 0; parts.length; depth++) {
    const left = [];
    for (const { piece, low, high, sum } of parts) {
      const middle = 0.5 * (low + high);
      const halves = [[low, middle], [middle, high]].map(([a, b]) => ({ piece, low: a, high: b }));
      for (const half of halves) half.sum = sumOver(half);
      const coarse = sum.some((value, j) => Math.abs(halves[0].sum[j] + halves[1].sum[j] - value) > enough[j]);
      if (coarse && depth < HALVINGS && samples.length < MOST_SAMPLES) left.push(...halves);
      else for (const half of halves) add(total, half.sum);
    }
    parts = left;
  }
  samples.sort((a, b) => a.piece - b.piece || a.s - b.s);
  const most = new Float64Array(sizes.length).fill(-Infinity);
  for (let k = 0; k < most.length; k++) most[k] = largestAlong(functions, motion, factor, samples, sizes, k);
  for (let k = 0; k < motion.rests; k++) {
    functions.atRest(motion, k, factor);
    for (let j = 0; j < most.length; j++) most[j] = Math.max(most[j], sizes[j]);
  }
  return { mean: total.map((value) => value / motion.duration), most, samples };
}

/** The largest value of one size: that of the samples, refined between them. */
function largestAlong(functions, motion, factor, samples, sizes, k) {
  let [top, low] = [-Infinity, Infinity];
  for (const sample of samples) {
    const value = sample.sizes[k];
    if (Number.isNaN(value)) return NaN;
    if (value > top) top = value;
    if (value < low) low = value;
  }
  if (!(top - low > 1e-14 * Math.max(Math.abs(top), Math.abs(low)))) return top;
  const level = top - CLOSE * (top - low);
  const found = [];
  for (let i = 0; i < samples.length; i++) {
    const value = samples[i].sizes[k];
    if (value < level || (i && samples[i - 1].sizes[k] > value) || (i + 1 < samples.length && samples[i + 1].sizes[k] > value)) continue;
    found.push(i);
  }
  found.sort((a, b) => samples[b].sizes[k] - samples[a].sizes[k]);
  for (const i of found.slice(0, CANDIDATES)) {
    const { piece, s } = samples[i];
    let low = samples[i - 1]?.piece === piece ? samples[i - 1].s : s;
    let high = samples[i + 1]?.piece === piece ? samples[i + 1].s : s;
    for (let turn = 0; turn < NARROWINGS && high > low; turn++) {
      let [best, value, least] = [0, -Infinity, Infinity];
      for (let j = 0; j < PROBES; j++) {
        functions.at(motion, piece, low + (high - low) * j / (PROBES - 1), factor);
        if (sizes[k] > value) [best, value] = [j, sizes[k]];
        if (sizes[k] < least) least = sizes[k];
      }
      if (value > top) top = value;
      const step = (high - low) / (PROBES - 1);
      [low, high] = [low + Math.max(best - 1, 0) * step, low + Math.min(best + 1, PROBES - 1) * step];
      if (!(value - least > ROUNDED * Math.abs(value))) break;
    }
  }
  return top;
}
