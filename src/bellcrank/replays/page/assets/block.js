// ---- numbers: what block.py packed, unpacked

/** An array of the block, row after row: undo the byte planes, the folded sign and the differences along columns. */
function unpacked(bytes, { at, rows, columns, order, step, from: begin = 0 }, Kind = Float32Array) {
  const size = rows * columns;
  const words = new Int32Array(size);
  for (let column = 0, from = at; column < columns; column++) {
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
    return begin === 0 ? floats : Float64Array.from(floats, (value) => begin + value);
  }
  const values = new Kind(size);
  for (let i = 0; i < size; i++) values[i] = begin + words[i] * step;
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

/** The frame before t, and how far on towards the next it is, 0 to 1. */
function between(times, t) {
  const index = Math.min(indexAt(times, t), Math.max(times.length - 2, 0));
  const span = times[index + 1] - times[index];
  return [index, span > 0 ? Math.min(Math.max((t - times[index]) / span, 0), 1) : 0];
}

/** The times of all lines of a chart as `time`, twice where one of them jumps, and each line's `values` there. */
function align(chart) {
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
  for (const line of chart.lines) line.values = line.time.length === times.length ? line.own : resampled(line, chart.time);
}

/** The values of a line at times that hold its own: of two of one time the first has the limit from before. */
function resampled({ time, own }, times) {
  const values = new Float64Array(times.length);
  for (let i = 0, row = 0; i < times.length; i++) {
    const t = times[i];
    const last = times[i + 1] !== t;  // the later of two sides
    while (row + 1 < time.length && (time[row + 1] < t || (last && time[row + 1] === t))) row++;
    const [a, b] = [time[row], time[row + 1]];
    if (t === a || row + 1 >= time.length) values[i] = own[row];
    else values[i] = t === b ? own[row + 1] : own[row] + (t - a) / (b - a) * (own[row + 1] - own[row]);
  }
  return values;
}

/** The film with every array it refers to in place. */
async function readFilm() {
  const film = JSON.parse(document.getElementById("film").textContent);
  const bytes = await window.bellcrank.inflated("block");
  const read = (reference, Kind) => unpacked(bytes, reference, Kind);
  film.time = read(film.time, Float64Array);
  film.places = read(film.places);
  film.turns = read(film.turns);
  for (const mesh of film.meshes) {
    mesh.vertices = read(mesh.vertices);
    mesh.faces = read(mesh.faces, Int32Array);
  }
  for (const { pieces } of film.traces) {
    for (const piece of pieces) {
      piece.time = read(piece.time, Float64Array);
      piece.points = read(piece.points);
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
      line.own = read(line.values);
    }
    align(chart);
  }
  for (const plane of film.planes) {
    plane.time = read(plane.time, Float64Array);
    plane.x = read(plane.x);
    plane.y = read(plane.y);
    for (const limit of plane.limits) limit.points = read(limit.points);
  }
  return film;
}
