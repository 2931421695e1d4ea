// ---- following: bodies that travel far are looked at from beside them

const SMALL = 0.2;  // of the view's height: bodies that take less of it may be followed
const TINY = 0.04;  // and those that take less are, or nothing would be seen of them
const NEAR = 0.9;  // what they take when they are followed

/** The camera's place: of the whole motion, or along with bodies that travel far; and the ground that goes with it. */
function makeFollower(THREE, viewer, camera, film, bodies, ground, layers) {
  const { controls } = viewer;
  const turned = ({ x, y, z }) => new THREE.Vector3(x, z, -y);
  const tangent = Math.tan(FIELD * Math.PI / 360);
  const away = camera.position.clone().sub(controls.target);
  const share = film.size / (tangent * away.length());
  const ratio = share / NEAR;  // of the distances
  const solid = bodies.filter((_, k) => film.bodies[k].shapes.length);
  const grounds = film.ground ? [makeGround(THREE, film.ground, film.extent)] : [];
  const far = share < SMALL && film.extent > 2 * film.size && solid.length > 0;
  if (film.ground && far) grounds.push(makeGround(THREE, film.ground, film.size));
  grounds.forEach((each) => each.moveTo(new THREE.Vector3(...film.camera.target)));
  if (grounds.length) ground.add(...grounds);
  const box = new THREE.Box3();
  const middle = () => box.setFromPoints(solid.map(({ position }) => position)).getCenter(new THREE.Vector3());
  const last = new THREE.Vector3();
  let on = far && share < TINY;
  const follower = {
    move() {
      if (!on) return;
      const now = middle();
      grounds[1]?.moveTo(now);
      const step = turned(now).sub(last);
      last.add(step);
      controls.target.add(step);
      camera.position.add(step);
    },
    reset() {
      controls.reset();
      if (!on) return;
      last.copy(turned(middle()));
      controls.target.copy(last);
      camera.position.copy(last).addScaledVector(away, ratio);
      follower.move();
    },
    get gridStep() { return gridStep(on ? film.size : film.extent); },
  };
  const take = (follow) => {
    on = follow;
    const scale = on ? ratio : 1;
    camera.near = Math.min(scale * away.length(), on ? film.size : film.extent) / 100;
    camera.far = 40 * (scale * away.length() + (on ? film.size : film.extent));
    camera.updateProjectionMatrix();
    controls.minDistance = scale * away.length() / 50;
    controls.maxDistance = 10 * away.length();
    grounds.forEach((each, k) => { each.visible = grounds.length === 1 || k === Number(on); });
    follower.reset();
  };
  if (on) for (const scale of film.scales) for (const key of ["length", "decade"]) scale[key] *= ratio;
  if (far) {
    layers.push({ group: "Camera", name: "follow what moves", colour: "transparent", objects: [], on, change: take });
  }
  take(on);
  return follower;
}
