// ---- scales of charts: ranges, ticks, noise, and the path of a line

const FLAT = 1e-6;  // of the size: smaller changes are not magnified
const OUTSTANDING = 30;  // ratio of peak to usual magnitude above which the scale is logarithmic
const NOISE = 1e-9;  // of a chart's largest value: rounding errors, displayed as 0

/**
 * A path from point to point, with subpixel accuracy, interrupted at every gap, however short. Of points in one column of
 * pixels it has the first, lowest, highest and last: thousands of them would take seconds to draw.
 */
function straightPath(u, number, first, last) {
  const [times, values] = [u.data[0], u.data[number]];
  const stroke = new Path2D();
  let column = null;  // of pixels: its number, and the points [x, y] that it keeps
  const finish = () => {
    if (!column) return;
    const { from, low, high, to } = column;
    const points = low[0] < high[0] ? [low, high, to] : [high, low, to];
    for (const point of points) if (point !== from) stroke.lineTo(...point);
  };
  for (let i = Math.max(first - 1, 0); i <= Math.min(last + 1, times.length - 1); i++) {
    if (values[i] === null || values[i] === undefined) {
      finish();
      column = null;
      continue;
    }
    const point = [u.valToPos(times[i], "x", true), u.valToPos(values[i], "y", true)];
    const at = Math.floor(point[0]);
    if (column?.at === at) {
      if (point[1] < column.low[1]) column.low = point;
      if (point[1] > column.high[1]) column.high = point;
      column.to = point;
      continue;
    }
    finish();
    if (column) stroke.lineTo(...point); else stroke.moveTo(...point);
    column = { at, from: point, low: point, high: point, to: point };
  }
  finish();
  const clip = new Path2D();
  clip.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
  return { stroke, fill: null, clip, band: null, gaps: null, flags: 1 };
}

/** The largest magnitude of the finite values. */
function largest(values) {
  let size = 0;
  for (const v of values) if (Number.isFinite(v)) size = Math.max(size, Math.abs(v));
  return size;
}

const withGaps = (values) => (values.every(Number.isFinite) ? values : Array.from(values, (v) => (Number.isFinite(v) ? v : null)));

/** The power of ten below the smallest positive value, where a logarithmic chart draws zeros; 0 without such values. */
function logarithmicFloor(lines) {
  let least = Infinity;
  for (const { values } of lines) for (const v of values) if (v > 0 && v < least) least = v;
  return least === Infinity ? 0 : 10 ** (Math.ceil(Math.log10(least)) - 1);
}

const raiseToFloor = (values, floor) => Array.from(values, (v) => (Number.isFinite(v) ? Math.max(v, floor) : null));

const decadeRange = (u, low, high) => (low === null ? [0.1, 10]
  : [10 ** Math.floor(Math.log10(low) + 1e-9), 10 ** Math.ceil(Math.log10(high) + (low === high ? 1 : 0) - 1e-9)]);

/** Powers of ten for the ticks of a logarithmic axis, limited to the available space. */
function powersOfTen(u, axis, low, high) {
  const [first, last] = [Math.round(Math.log10(low)), Math.round(Math.log10(high))];
  const every = Math.max(Math.ceil((last - first) / 5), 1);
  return Array.from({ length: Math.floor((last - first) / every) + 1 }, (_, k) => 10 ** (first + k * every));
}

/** The magnitude below which most values stay, if a few are far larger and would hide them on a linear scale; else 0. */
function usualMagnitude(times, all) {
  const peak = Math.max(...all.map(largest));
  const spans = [];  // [magnitude, duration]: samples are dense where lines bend, so that durations are counted, not samples
  let total = 0;
  for (const values of all) {
    for (let i = 0; i < times.length; i++) {
      const size = Math.abs(values[i]);
      if (!(size > NOISE * peak && size < Infinity)) continue;
      const long = times[Math.min(i + 1, times.length - 1)] - times[Math.max(i - 1, 0)];
      spans.push([size, long]);
      total += long;
    }
  }
  if (spans.length <= 20) return 0;
  spans.sort(([a], [b]) => a - b);
  let left = 0.95 * total;
  const usual = (spans.find(([, long]) => (left -= long) < 0) ?? spans.at(-1))[0];
  return peak > OUTSTANDING * usual ? usual : 0;
}

const widenedRange = (u, low, high) => (low === null ? [-1, 1] : [low * (low < 0 ? 1.6 : 0.6), high * (high > 0 ? 1.6 : 0.6)]);

/** Zero and powers of ten on both sides, for an axis that is logarithmic above a value. */
function symmetricPowers(usual, low, high) {
  const first = Math.ceil(Math.log10(3 * usual));
  const last = Math.floor(Math.log10(Math.max(high, -low)));
  const every = Math.max(Math.ceil((last - first) / 2), 1);
  const sizes = [];
  for (let k = last; k >= first; k -= every) sizes.push(10 ** k);
  return [...sizes.map((size) => -size), 0, ...sizes.reverse()].filter((value) => value >= low && value <= high);
}

/** The range of an axis; a change below FLAT is not magnified, so that rounding does not look like a signal. */
function valueRange(u, low, high) {
  if (low === null || low === undefined) return [-1, 1];
  const size = Math.max(Math.abs(low), Math.abs(high));
  if (high - low <= FLAT * size) return size === 0 ? [-1, 1] : [(low + high) / 2 - 0.05 * size, (low + high) / 2 + 0.05 * size];
  const margin = 0.06 * (high - low);
  return [low - margin, high + margin];
}

const tickText = (value) => (value === null || value === undefined ? "" : formatNumber(Number(value.toPrecision(10)), 6));

/** The width of an axis: equal for all plots, so that they are aligned, unless labels are long. */
const axisWidth = (u, labels) => Math.max(62, 14 + 7.5 * Math.max(...(labels ?? [""]).map((text) => text.length)));
