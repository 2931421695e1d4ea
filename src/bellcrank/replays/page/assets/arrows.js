// ---- arrows for forces and torques

const UP = [0, 1, 0];

/** The length (m) of an arrow of a magnitude: linear up to the usual magnitude, logarithmic above it. */
function arrowLength({ usual, length, decade }, magnitude) {
  return magnitude <= usual ? length * magnitude / usual : length + decade * Math.log10(magnitude / usual);
}

/** The meaning of a scale, in short or in full. */
function scaleText({ unit, usual, length, decade, peak }, full) {
  if (peak === 0) return "";
  const round = roundBelow(usual);
  const amount = (value, digits) => `${formatNumber(value, digits)} ${formatUnit(unit)}`;
  const text = `arrow of ${formatNumber(length * round / usual, 2)} m = ${amount(round)}`;
  if (decade === 0) return text;
  const above = `logarithmic above ${amount(usual, 2)}`;
  return full ? `${text}; ${above}: ${formatNumber(decade, 2)} m more for each factor of ten, up to ${amount(peak, 3)}` : `${text}, ${above}`;
}

/** The largest of 1, 2 and 5 times a power of ten that does not exceed a positive number. */
function roundBelow(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * (value / power >= 5 ? 5 : value / power >= 2 ? 2 : 1);
}

/** An arrow from the origin along y: a shaft that is scaled, a head that is not, and a ring for a torque. */
function makeArrow(THREE, cache, { is_torque: isTorque }, colour, longest) {
  const thick = 0.026 * longest;
  const head = 0.2 * longest;
  const shaftShape = cache.once("shaft", () => new THREE.CylinderGeometry(thick, thick, 1, 10).translate(0, 0.5, 0));
  const cone = (at) => new THREE.ConeGeometry(2.6 * thick, head, 14).translate(0, at, 0);
  const headShape = isTorque
    ? cache.once("two heads", () => mergedGeometry(THREE, cone(-head / 2), cone(-head)))
    : cache.once("head", () => cone(-head / 2));
  const ringShape = isTorque && cache.once("ring", () => {
    const radius = 0.26 * longest;
    const arc = 1.55 * Math.PI;
    const tip = new THREE.ConeGeometry(2.2 * thick, 0.6 * head, 12).rotateZ(arc)
      .translate(radius * Math.cos(arc), radius * Math.sin(arc), 0);
    return mergedGeometry(THREE, new THREE.TorusGeometry(radius, 0.8 * thick, 6, 28, arc), tip).rotateX(-Math.PI / 2);
  });
  const solid = new THREE.MeshLambertMaterial({ color: colour, emissive: colour, emissiveIntensity: 0.12 });
  // The part inside a body is visible through it.
  const ghost = new THREE.MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.28, depthFunc: THREE.GreaterDepth, depthWrite: false });
  const arrow = new THREE.Group();
  const parts = [shaftShape, headShape, ringShape].filter(Boolean).map((shape) => {
    const part = new THREE.Group();
    part.add(new THREE.Mesh(shape, solid), new THREE.Mesh(shape, ghost));
    part.children[1].renderOrder = 1;
    arrow.add(part);
    return part;
  });
  const [shaft, tip, ring] = parts;
  const up = new THREE.Vector3(...UP);
  const direction = new THREE.Vector3();
  arrow.shape = (x, y, z, magnitude, length) => {
    const small = Math.min(1, length / (1.6 * head));  // a short arrow has a small head
    direction.set(x / magnitude, y / magnitude, z / magnitude);
    arrow.quaternion.setFromUnitVectors(up, direction);
    shaft.scale.set(small, Math.max(length - 0.9 * head * small, 1e-9), small);
    tip.position.y = length;
    tip.scale.setScalar(small);
    if (ring) {
      ring.position.y = 0.35 * length;
      ring.scale.setScalar(small);
    }
  };
  return arrow;
}
