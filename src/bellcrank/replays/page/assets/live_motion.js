// ---- sums (as sizing/loads/motion_grid.py) and largest values along a motion, whatever the quantities are

const PARTS = 300;  // of a whole motion, at least
const NODES = [0.5 - Math.sqrt(0.15), 0.5, 0.5 + Math.sqrt(0.15)];  // of Gauss and Legendre's rule
const WEIGHTS = [5 / 18, 8 / 18, 5 / 18];
const [HALVINGS, SETTLED, LEAST_SUM] = [16, 1e-10, 1e-12];  // a part is halved until that changes no sum by this share of it
const CUTS = 14;  // bisections of a part in which a torque changes sign
const NOISE_AT_ZERO = 1e-9;  // of a torque's largest value: signs of smaller ones are rounding
const MOST_SAMPLES = 200_000;
const [ROUNDING_DEPTH, ROUNDING_PARTS] = [2, 64];  // see `alongMotion`
const [CANDIDATES, CLOSE, SAME, PROBES, NARROWINGS, ROUNDED] = [12, 0.02, 1e-7, 9, 13, 4e-16];  // local maxima that are refined

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

  const even = motion.pieces.map(({ quintic, low, high }) => {
    const count = Math.max(1, Math.ceil(PARTS * (high - low) * motion.length[quintic] / motion.duration - 1e-9));
    return Array.from({ length: count + 1 }, (_, k) => low + (high - low) * k / count);
  });
  const noise = torqueNoise(functions, motion, factor, even);
  let parts = [];
  for (let piece = 0; piece < motion.pieces.length; piece++) {
    const edges = even[piece].flatMap((edge, k) => (k ? [...signChanges(functions, motion, piece, even[piece][k - 1], edge, factor, noise), edge] : [edge]));
    edges.forEach((edge, k) => {
      at(piece, edge);
      if (k === 0) return;
      const part = { piece, low: edges[k - 1], high: edge };
      parts.push({ ...part, sum: sumOver(part) });
    });
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
    // Halves of a part with a bend are one that settles and one that does not; where many grow in
    // number, the sums change by rounding, which halving does not settle.
    const rounding = depth >= ROUNDING_DEPTH && left.length > ROUNDING_PARTS && left.length > parts.length;
    if (rounding) for (const { sum } of left) add(total, sum);
    parts = rounding ? [] : left;
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

/** The torques of the joints up to which signs are rounding. */
function torqueNoise(functions, motion, factor, even) {
  const largest = new Float64Array(motion.loads);
  even.forEach((edges, piece) => edges.forEach((s) => {
    torquesAt(functions, motion, piece, s, factor).forEach((torque, j) => { largest[j] = Math.max(largest[j], Math.abs(torque)); });
  }));
  const least = LEAST_SUM * Math.max(...largest);
  return largest.map((value) => (value > least ? NOISE_AT_ZERO * value : Infinity));
}

function torquesAt(functions, motion, piece, s, factor) {
  functions.at(motion, piece, s, factor);
  return functions.view("shown").slice(0, motion.loads);
}

/** The shares of a quintic between two at which torques change sign: there the losses of gears do, and motor torques bend. */
function signChanges(functions, motion, piece, low, high, factor, noise) {
  const signsAt = (s) => Array.from(torquesAt(functions, motion, piece, s, factor), (torque) => torque > 0);
  const [first, last] = [low, high].map((s) => torquesAt(functions, motion, piece, s, factor));
  const found = Array.from(first.keys()).flatMap((j) => {
    const sign = first[j] > 0;
    if (sign === last[j] > 0 || Math.max(Math.abs(first[j]), Math.abs(last[j])) <= noise[j]) return [];
    let [before, after] = [low, high];
    for (let turn = 0; turn < CUTS; turn++) {
      const middle = 0.5 * (before + after);
      if (signsAt(middle)[j] === sign) before = middle; else after = middle;
    }
    return [0.5 * (before + after)];
  });
  return [...new Set(found)].sort((a, b) => a - b);
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
  const within = SAME * (top - low);  // the two samples where pieces meet differ by rounding
  for (let i = 0; i < samples.length; i++) {
    const { piece, sizes: { [k]: value } } = samples[i];
    const higher = (one) => one !== undefined && one.sizes[k] > value + (one.piece === piece ? 0 : within);
    if (value >= level && !higher(samples[i - 1]) && !higher(samples[i + 1])) found.push(i);
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
