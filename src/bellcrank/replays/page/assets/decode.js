// ---- arrays: what array_encoding.py encoded

/** An array of the block, row by row: undo the byte planes, the folded sign and the differences along columns. */
function decodeArray(bytes, { offset, rows, columns, order, step, base = 0 }, Kind = Float32Array) {
  const size = rows * columns;
  const words = new Int32Array(size);
  for (let column = 0, from = offset; column < columns; column++) {
    let word = 0;
    let slope = 0;
    for (let to = column; to < size; to += columns, from++) {
      const folded = bytes[from] | bytes[from + size] << 8 | bytes[from + 2 * size] << 16 | bytes[from + 3 * size] << 24;
      const difference = folded >>> 1 ^ -(folded & 1);
      slope = order === 2 ? slope + difference | 0 : difference;
      words[to] = word = word + slope | 0;
    }
  }
  if (step === 0) {  // the words are the bits of float32
    const floats = new Float32Array(words.buffer);
    return base === 0 ? floats : Float64Array.from(floats, (value) => base + value);
  }
  const values = new Kind(size);
  for (let i = 0; i < size; i++) values[i] = base + words[i] * step;
  return values;
}

/** The index of the last of increasing `times` that is not after t; 0 before the first. */
function indexAt(times, t) {
  let low = 0;
  let high = times.length - 1;
  while (low < high) {
    const middle = low + high + 1 >> 1;
    if (times[middle] <= t) low = middle; else high = middle - 1;
  }
  return low;
}

/** The index of the frame before t, and the fraction of the way to the next frame, 0 to 1. */
function interpolationAt(times, t) {
  const index = Math.min(indexAt(times, t), Math.max(times.length - 2, 0));
  const span = times[index + 1] - times[index];
  return [index, span > 0 ? Math.min(Math.max((t - times[index]) / span, 0), 1) : 0];
}

/** Sets `chart.time` to the times of all lines, twice where one of them jumps, and the `values` of each line there. */
function alignTimes(chart) {
  const lines = chart.lines.filter(({ time }, k) => chart.lines.findIndex((other) => other.time === time) === k);
  const next = lines.map(() => 0);
  const times = [];
  for (;;) {
    let t = Infinity;
    for (let k = 0; k < lines.length; k++) if (next[k] < lines[k].time.length) t = Math.min(t, lines[k].time[next[k]]);
    if (t === Infinity) break;
    let count = 0;
    for (let k = 0; k < lines.length; k++) {
      const from = next[k];
      while (lines[k].time[next[k]] === t) next[k]++;
      count = Math.max(count, next[k] - from);
    }
    for (; count > 0; count--) times.push(t);
  }
  chart.time = Float64Array.from(times);
  for (const line of chart.lines) line.values = line.time.length === times.length ? line.samples : resample(line, chart.time);
}

/** The values of a line at times that include its own; the first of two equal times has the limit from the left. */
function resample({ time, samples }, times) {
  const values = new Float64Array(times.length);
  for (let i = 0, row = 0; i < times.length; i++) {
    const t = times[i];
    const last = times[i + 1] !== t;  // the later of two sides
    while (row + 1 < time.length && (time[row + 1] < t || (last && time[row + 1] === t))) row++;
    const [a, b] = [time[row], time[row + 1]];
    if (t === a || row + 1 >= time.length) values[i] = samples[row];
    else values[i] = t === b ? samples[row + 1] : samples[row] + (t - a) / (b - a) * (samples[row + 1] - samples[row]);
  }
  return values;
}

/** The film, with an array in place of each reference. */
async function readFilm() {
  const film = JSON.parse(document.getElementById("film").textContent);
  const bytes = await window.bellcrank.inflated("arrays");
  const read = (reference, Kind) => decodeArray(bytes, reference, Kind);
  film.time = read(film.time, Float64Array);
  film.positions = read(film.positions);
  film.quaternions = read(film.quaternions);
  for (const mesh of film.meshes) {
    mesh.vertices = read(mesh.vertices);
    mesh.faces = read(mesh.faces, Int32Array);
  }
  for (const { segments } of film.traces) {
    for (const segment of segments) {
      segment.time = read(segment.time, Float64Array);
      segment.points = read(segment.points);
    }
  }
  for (const arrow of film.arrows) {
    arrow.time = read(arrow.time, Float64Array);
    arrow.points = read(arrow.points);
    arrow.vectors = read(arrow.vectors);
  }
  for (const part of [...film.springs, ...film.rods]) part.ends = read(part.ends);
  for (const chart of film.charts) {
    for (const line of chart.lines) {
      line.time = read(line.time, Float64Array);
      line.samples = read(line.values);
    }
    alignTimes(chart);
  }
  for (const plot of film.xy_plots) {
    plot.time = read(plot.time, Float64Array);
    plot.x = read(plot.x);
    plot.y = read(plot.y);
    for (const limit of plot.limits) limit.points = read(limit.points);
  }
  return film;
}
