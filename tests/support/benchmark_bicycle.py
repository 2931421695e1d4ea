"""The benchmark bicycle of Meijaard et al.: 25 parameters as a URDF with two rolling disks, and its linear equations.

J. P. Meijaard, J. M. Papadopoulos, A. Ruina & A. L. Schwab, Linearized dynamics equations for the balance and steer of
a bicycle: a benchmark and review, Proc. R. Soc. A 463 (2007): parameters in table 1, published matrices in eq. 5.4.

The paper's axes are x forwards, y to the right and z down, from the rear contact; here z is up and y to the left, which
changes the sign of products of inertia with z. The rear frame is the free base, its frame at the rear wheel's centre.
"""

from pathlib import Path

import numpy as np

GRAVITY = 9.81
WHEELBASE, TRAIL, TILT = 1.02, 0.08, np.pi / 10.0
REAR_RADIUS, FRONT_RADIUS = 0.3, 0.35

# eq. 5.4: M q̈ + v C1 q̇ + (g K0 + v² K2) q = 0 for q = (lean, steer)
MASS = np.array([[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]])
DAMPING = np.array([[0.0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]])
GRAVITY_STIFFNESS = np.array([[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]])
SPEED_STIFFNESS = np.array([[0.0, 76.59734589573222], [0.0, 2.65431523794604]])


def published_eigenvalues(speed: float) -> np.ndarray:
    """The four eigenvalues (1/s) of the published equations at a forward speed, m/s."""
    stiffness = GRAVITY * GRAVITY_STIFFNESS + speed**2 * SPEED_STIFFNESS
    inverse = np.linalg.inv(MASS)
    zero, one = np.zeros((2, 2)), np.eye(2)
    return np.linalg.eigvals(np.block([[zero, one], [-inverse @ stiffness, -inverse @ (speed * DAMPING)]]))


def link(name: str, mass: float, centre: tuple[float, float, float], inertia: tuple[float, float, float, float]) -> str:
    xx, yy, zz, xz = inertia
    return (
        f'<link name="{name}"><inertial><origin xyz="{centre[0]!r} {centre[1]!r} {centre[2]!r}"/><mass value="{mass}"/>'
        f'<inertia ixx="{xx}" ixy="0" ixz="{xz}" iyy="{yy}" iyz="0" izz="{zz}"/></inertial></link>\n'
    )


def write_bicycle(folder: Path, speed: float) -> Path:
    """Write the bicycle's URDF and a scene in which it rides straight at a speed, m/s; the scene's path."""
    rear = np.array([0.0, 0.0, REAR_RADIUS])
    # the steering axis meets the ground at w + c and leans backwards by the tilt; its joint is put at the front
    # wheel's height
    ground, up = np.array([WHEELBASE + TRAIL, 0.0, 0.0]), np.array([-np.sin(TILT), 0.0, np.cos(TILT)])
    head = ground + up * (FRONT_RADIUS / np.cos(TILT))
    front = np.array([WHEELBASE, 0.0, FRONT_RADIUS])

    def at(point: np.ndarray) -> str:
        return " ".join(repr(float(x)) for x in point)

    axis = at(up)
    text = '<?xml version="1.0"?>\n<robot name="benchmark_bicycle">\n'
    text += link("frame", 85.0, tuple((np.array([0.3, 0.0, 0.9]) - rear).tolist()), (9.2, 11.0, 2.8, -2.4))
    text += link("rear_wheel", 2.0, (0.0, 0.0, 0.0), (0.0603, 0.12, 0.0603, 0.0))
    text += link("fork", 4.0, tuple((np.array([0.9, 0.0, 0.7]) - head).tolist()), (0.05892, 0.06, 0.00708, 0.00756))
    text += link("front_wheel", 3.0, (0.0, 0.0, 0.0), (0.1405, 0.28, 0.1405, 0.0))
    joints = (
        ("rear_axle", "frame", "rear_wheel", at(np.zeros(3)), "0 1 0"),
        ("steer", "frame", "fork", at(head - rear), axis),
        ("front_axle", "fork", "front_wheel", at(front - head), "0 1 0"),
    )
    for name, parent, child, origin, about in joints:
        text += f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
        text += f'<origin xyz="{origin}"/><axis xyz="{about}"/></joint>\n'
    (folder / "bicycle.urdf").write_text(text + "</robot>\n", encoding="utf-8")
    scene = folder / f"bicycle_{speed:g}.yaml"
    scene.write_text(
        f"""name: Benchmark bicycle at {speed:g} m/s
urdf: bicycle.urdf
floating_base: true
gravity: [0, 0, -{GRAVITY}]
friction: none
constraints:
  - {{name: rear, kind: rolling_disk, frame: rear_wheel, axis: [0, 1, 0], radius: {REAR_RADIUS}}}
  - {{name: front, kind: rolling_disk, frame: front_wheel, axis: [0, 1, 0], radius: {FRONT_RADIUS}}}
base: {{position: [0, 0, {REAR_RADIUS}], rpy: [0, 0, 0],
       linear_velocity: [{speed!r}, 0, 0], angular_velocity: [0, 0, 0]}}
initial: {{steer: 0, rear_axle: 0, front_axle: 0,
  velocity: {{steer: 0, rear_axle: {speed / REAR_RADIUS!r}, front_axle: {speed / FRONT_RADIUS!r}}}}}
""",
        encoding="utf-8",
    )
    return scene
