// ---- arrows for forces and torques

const UP = [0, 1, 0];

/** How long an arrow of that magnitude is (m): linear to the usual, logarithmic above. */
function arrowLength({ usual, length, decade }, magnitude) {
  return magnitude <= usual ? length * magnitude / usual : length + decade * Math.log10(magnitude / usual);
}

/** What a scale means, in short, and in full. */
function scaleText({ unit, usual, length, decade, peak }, full) {
  if (peak === 0) return "";
  const round = roundBelow(usual);
  const amount = (value, digits) => `${shown(value, digits)} ${unitShown(unit)}`;
  const text = `arrow of ${shown(length * round / usual, 2)} m = ${amount(round)}`;
  if (decade === 0) return text;
  const above = `logarithmic above ${amount(usual, 2)}`;
  return full ? `${text}; ${above}: ${shown(decade, 2)} m more for each factor of ten, up to ${amount(peak, 3)}` : `${text}, ${above}`;
}

/** The largest of 1, 2 and 5 times a power of ten that is not above a positive number. */
function roundBelow(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * (value / power >= 5 ? 5 : value / power >= 2 ? 2 : 1);
}

/** An arrow from the origin along y: a shaft that is stretched, a head that is not, and a ring if it turns about. */
function makeArrow(THREE, stock, { about }, colour, longest) {
  const thick = 0.026 * longest;
  const head = 0.2 * longest;
  const shaftShape = stock.once("shaft", () => new THREE.CylinderGeometry(thick, thick, 1, 10).translate(0, 0.5, 0));
  const cone = (at) => new THREE.ConeGeometry(2.6 * thick, head, 14).translate(0, at, 0);
  const headShape = about
    ? stock.once("two heads", () => merged(THREE, cone(-head / 2), cone(-head)))
    : stock.once("head", () => cone(-head / 2));
  const ringShape = about && stock.once("ring", () => {
    const radius = 0.26 * longest;
    const arc = 1.55 * Math.PI;
    const tip = new THREE.ConeGeometry(2.2 * thick, 0.6 * head, 12).rotateZ(arc)
      .translate(radius * Math.cos(arc), radius * Math.sin(arc), 0);
    return merged(THREE, new THREE.TorusGeometry(radius, 0.8 * thick, 6, 28, arc), tip).rotateX(-Math.PI / 2);
  });
  const solid = new THREE.MeshLambertMaterial({ color: colour, emissive: colour, emissiveIntensity: 0.12 });
  // What is inside a body shines through it.
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
