// ---- animation: each function adds something to the view and returns a function that updates it to a time

const MANY = 8;  // arrows or axes: more than these hide the robot, and are hidden at first

/** Poses of bodies: positions are interpolated linearly, orientations at a constant rate. */
function bodyUpdater(THREE, film, bodies) {
  return (frame, part) => {
    const { positions, quaternions } = film;
    const last = (frame + 1) * bodies.length * 3 < positions.length ? 1 : 0;  // a film of one frame has no next frame
    for (let k = 0; k < bodies.length; k++) {
      const a = frame * bodies.length + k;
      const b = a + last * bodies.length;
      const { position, quaternion } = bodies[k];
      position.set(...[0, 1, 2].map((i) => positions[3 * a + i] + part * (positions[3 * b + i] - positions[3 * a + i])));
      THREE.Quaternion.slerpFlat(rotation, 0, quaternions, 4 * a, quaternions, 4 * b, part);
      quaternion.fromArray(rotation).normalize();
    }
  };
}
const rotation = [0, 0, 0, 1];

/** Translucent copies of the bodies for another motion, with a layer; they rest where it has ended. */
function addGhost(THREE, world, layers, bodies, kind) {
  const look = new THREE.MeshLambertMaterial({ color: 0x8592a0, transparent: true, opacity: 0.3, depthWrite: false });
  const copies = bodies.map((body) => body.clone());
  const [group, inner] = [new THREE.Group(), new THREE.Group().add(...copies)];
  inner.traverse((part) => { if (part.isMesh) part.material = look; });
  inner.visible = false;
  world.add(group.add(inner));
  layers.push({ group: kind === "run" ? "Run of the file" : "Posture", name: "translucent", colour: "#8592a0", objects: [group], on: true });
  let other = null;
  return {
    copies,
    get visible() { return inner.visible && group.visible; },
    show(motion) {
      other = motion;
      inner.visible = motion !== null;
    },
    move(frame, part, t) {
      if (other) bodyUpdater(THREE, other, copies)(...interpolationAt(other.time, t));
    },
  };
}

/** Three numbers at column `at` of rows of `width` numbers, a fraction `part` of the way from a frame to the next. */
function interpolate3(values, width, at, frame, part) {
  const a = frame * width + at;
  const b = a + width < values.length ? a + width : a;
  return [0, 1, 2].map((i) => values[a + i] + part * (values[b + i] - values[a + i]));
}

function addTrace(THREE, world, layers, trace, colour, size) {
  const { name } = trace;
  const group = new THREE.Group();
  let drawn = null;  // the segments of which the lines are
  let lines = [];
  const draw = () => {
    for (const [line] of lines) line.geometry.dispose();
    group.clear();
    drawn = trace.segments;
    lines = drawn.map(({ time, points }) => {
      const count = time.length;
      const packed = new Float32Array(4 * count);
      for (let i = 0; i < count; i++) packed.set([points[3 * i], points[3 * i + 1], points[3 * i + 2], time[i] - time[0]], 4 * i);
      const line = makeLine(THREE, packed, { colour, width: 2.6, size });
      group.add(line);
      return [line, time];
    });
  };
  draw();
  world.add(group);
  layers.push({ group: "Traces", name, colour, objects: [group], on: true });
  return (frame, part, t) => {
    if (drawn !== trace.segments) draw();
    for (const [line, time] of lines) {
      line.visible = t > time[0];
      if (line.visible) line.upTo(indexAt(time, t), t - time[0]);
    }
  };
}

function addSpring(THREE, world, layers, film, part) {
  const { name, ends } = part;
  let total = 0;
  for (let i = 0; i < ends.length; i += 6) total += Math.hypot(ends[i + 3] - ends[i], ends[i + 4] - ends[i + 1], ends[i + 5] - ends[i + 2]);
  const mean = total / (ends.length / 6) || 1;
  const shape = coil(THREE, mean, Math.min(0.12 * mean, 0.035 * film.extent), 12);
  const spring = new THREE.Mesh(shape, new THREE.MeshLambertMaterial({ color: 0x8592a0 }));
  const up = new THREE.Vector3(...UP);
  const along = new THREE.Vector3();
  const group = new THREE.Group().add(spring);
  world.add(group);
  layers.push({ group: "Springs", name, colour: "#8592a0", objects: [group], on: true });
  return (frame, share) => {
    const start = interpolate3(part.ends, 6, 0, frame, share);
    along.fromArray(interpolate3(part.ends, 6, 3, frame, share)).sub(spring.position.fromArray(start));
    const length = along.length();
    spring.visible = length > 1e-9;
    if (!spring.visible) return;
    spring.quaternion.setFromUnitVectors(up, along.divideScalar(length));
    spring.scale.set(1, length / mean, 1);
  };
}

/** A thin rod between two points. */
function addRod(THREE, world, layers, cache, film, part) {
  const { name } = part;
  const [cylinder] = cache.geometry({ kind: "cylinder", size: [1, 1] });
  const rod = new THREE.Mesh(cylinder, cache.material(ROD));
  const along = new THREE.Vector3();
  const axis = new THREE.Vector3(0, 0, 1);
  const group = new THREE.Group().add(rod);
  world.add(group);
  layers.push({ group: "Rods", name, colour: "#4a5560", objects: [group], on: true });
  return (frame, share) => {
    const start = interpolate3(part.ends, 6, 0, frame, share);
    along.fromArray(interpolate3(part.ends, 6, 3, frame, share)).sub(rod.position.fromArray(start));
    const length = along.length();
    rod.visible = length > 1e-9;
    if (!rod.visible) return;
    rod.position.addScaledVector(along, 0.5);
    rod.quaternion.setFromUnitVectors(axis, along.divideScalar(length));
    const radius = Math.min(0.008 * film.size, 0.05 * length);
    rod.scale.set(radius, radius, length);
  };
}
const ROD = [0.29, 0.33, 0.38, 1];  // red, green, blue, opacity

function addArrow(THREE, world, layers, cache, film, data, number) {
  const scale = film.scales[data.scale];
  const longest = Math.max(...film.scales.map(({ usual, length, decade, peak }) => arrowLength({ usual, length, decade }, peak)));
  const colour = PALETTE[number % 6 === 0 ? 0 : number % 6];
  const arrow = makeArrow(THREE, cache, data, colour, longest || 1);
  const group = new THREE.Group().add(arrow);
  world.add(group);
  layers.push({ group: "Arrows", name: `${data.name} [${formatUnit(scale.unit)}]`, colour, objects: [group], on: film.arrows.length <= MANY });
  return (frame, part, t) => {
    const [row, share] = interpolationAt(data.time, t);  // arrows have their own times: a force may jump while nothing moves
    const [x, y, z] = interpolate3(data.vectors, 3, 0, row, share);
    const magnitude = Math.hypot(x, y, z);
    arrow.visible = magnitude > 1e-9 * scale.peak && Number.isFinite(magnitude);
    if (!arrow.visible) return;
    arrow.position.fromArray(interpolate3(data.points, 3, 0, row, share));
    arrow.shape(x, y, z, magnitude, arrowLength(scale, magnitude));
  };
}

/** The axis of the joint whose limit is active, thick and red; nothing where there is none. */
function addLimitedAxes(THREE, world, bodies, layers, film, size) {
  if (!film.limits.some(({ axis }) => axis >= 0)) return [];
  const half = 0.12 * film.size;
  const packed = new Float32Array(8);
  const line = makeLine(THREE, packed, { colour: "#D62728", width: 6, size, pairs: true, onTop: true });
  const group = new THREE.Group().add(line);
  world.add(group);
  layers.push({ group: "Joints", name: "joint that limits", colour: "#D62728", objects: [group], on: true });
  const end = new THREE.Vector3();
  return [(frame, part, t) => {
    const axis = film.axes[activeLimit(film.limits, t)?.axis ?? -1];
    line.visible = axis !== undefined;
    if (!axis) return;
    const { position, quaternion } = bodies[axis.body];
    const direction = new THREE.Vector3(...axis.direction).normalize();
    [-half, half].forEach((along, k) => end.set(...axis.point).addScaledVector(direction, along).applyQuaternion(quaternion).add(position).toArray(packed, 4 * k));
    line.changed();
  }];
}

/** Axes, and spirals for torsion springs, drawn over the bodies: one line of segments for all of a kind. */
function addAxes(THREE, world, bodies, layers, film, size) {
  const half = 0.08 * film.size;
  const stick = [[0, 0, -half], [0, 0, half]];
  const kinds = [
    { name: "axes", colour: "#E69F00", parts: film.axes.map((axis) => [axis, stick]) },
    { name: "torsion springs", colour: "#CC79A7", parts: film.axes.filter((axis) => axis.torsion_spring).map((axis) => [axis, spiral(0.6 * half)]) },
  ];
  const along = new THREE.Vector3(0, 0, 1);
  const place = new THREE.Vector3();
  return kinds.filter(({ parts }) => parts.length).map(({ name, colour, parts }) => {
    const corners = parts.flatMap(([{ body, point, direction }, points]) => {
      const turned = new THREE.Quaternion().setFromUnitVectors(along, new THREE.Vector3(...direction).normalize());
      const placed = points.map((each) => new THREE.Vector3(...each).applyQuaternion(turned).add(new THREE.Vector3(...point)));
      return placed.slice(1).flatMap((end, k) => [[bodies[body], placed[k]], [bodies[body], end]]);
    });
    const packed = new Float32Array(4 * corners.length);
    const line = makeLine(THREE, packed, { colour, width: 1.5, size, pairs: true, onTop: true });
    world.add(line);
    layers.push({ group: "Joints", name, colour, objects: [line], on: parts.length <= MANY });
    return () => {
      if (!line.visible) return;
      corners.forEach(([{ position, quaternion }, point], i) => place.copy(point).applyQuaternion(quaternion).add(position).toArray(packed, 4 * i));
      line.changed();
    };
  });
}
