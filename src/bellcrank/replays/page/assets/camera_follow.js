// ---- camera follow: the camera moves along with bodies that travel far

const SMALL = 0.2;  // of the view's height: smaller bodies can be followed
const TINY = 0.04;  // smaller bodies are followed from the start: they would hardly be visible otherwise
const NEAR = 0.9;  // size of bodies that are followed

/** Moves the camera along with bodies that travel far, if switched on, and the ground with it. */
function makeCameraFollow(THREE, viewer, camera, film, bodies, ground, layers) {
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
  grounds.forEach((each) => each.placeBelow(new THREE.Vector3(...film.camera.target)));
  if (grounds.length) ground.add(...grounds);
  const box = new THREE.Box3();
  const middle = () => box.setFromPoints(solid.map(({ position }) => position)).getCenter(new THREE.Vector3());
  const last = new THREE.Vector3();
  let on = far && share < TINY;
  const cameraFollow = {
    move() {
      if (!on) return;
      const now = middle();
      grounds[1]?.placeBelow(now);
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
      cameraFollow.move();
    },
    get gridStep() { return gridStep(on ? film.size : film.extent); },
  };
  const setFollow = (follow) => {
    on = follow;
    const scale = on ? ratio : 1;
    camera.near = Math.min(scale * away.length(), on ? film.size : film.extent) / 100;
    camera.far = 40 * (scale * away.length() + (on ? film.size : film.extent));
    camera.updateProjectionMatrix();
    controls.minDistance = scale * away.length() / 50;
    controls.maxDistance = 10 * away.length();
    grounds.forEach((each, k) => { each.visible = grounds.length === 1 || k === Number(on); });
    cameraFollow.reset();
  };
  if (on) for (const scale of film.scales) for (const key of ["length", "decade"]) scale[key] *= ratio;
  if (far) {
    layers.push({ group: "Camera", name: "follow the bodies", colour: "transparent", objects: [], on, change: setFollow });
  }
  setFollow(on);
  return cameraFollow;
}
