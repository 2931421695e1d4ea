"""Random mechanisms: a random tree, closed by random constraints that hold at a random posture."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
import yaml
from scipy.spatial.transform import Rotation

from bellcrank.scene.scene import load_scene

INERTIA = '<inertial><mass value="1"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.025"/></inertial>'
LOOPS = {"point": 3, "hinge": 5, "weld": 6, "distance": 1, "coupling": 1}  # rows


@dataclass(frozen=True, eq=False)
class RandomMechanism:
    """A scene, and a posture (nq,) at which its constraints hold."""

    scene: object
    posture: np.ndarray


def random_mechanism(seed, folder):
    """A tree of 3 to 10 joints with 1 to 3 constraints; the given start is the neutral posture."""
    random = np.random.default_rng(seed)
    count = int(random.integers(3, 11))
    joints, limits = [], []
    for k in range(count):
        kind = "prismatic" if random.random() < 0.2 else "revolute" if random.random() < 0.7 else "continuous"
        reach = 0.4 if kind == "prismatic" else np.pi if kind == "continuous" else random.uniform(1.0, 2.5)
        joints.append((k + 1, int(random.integers(0, k + 1)), kind, reach))
        limits.append(reach)
    path = folder / f"random_{seed}.urdf"
    path.write_text(_urdf(joints, random))
    posture = random.uniform(-0.8, 0.8, count) * limits
    data = {"name": f"Random {seed}", "urdf": path.name, "gravity": [0, 0, 0]}
    (folder / f"random_{seed}.yaml").write_text(
        yaml.safe_dump(data | _closures(path, joints, posture, random, count), sort_keys=False)
    )
    scene = load_scene(folder / f"random_{seed}.yaml")
    ordered = np.array([posture[int(joint.name.removeprefix("joint_")) - 1] for joint in scene.robot.joints])
    return RandomMechanism(scene, ordered)


def _vector(values):
    return " ".join(f"{value:.17g}" for value in values)


def _urdf(joints, random):
    lines = ['<robot name="random">', f'<link name="link_0">{INERTIA}</link>']
    for child, parent, kind, reach in joints:
        axis = random.normal(size=3)
        limit = "" if kind == "continuous" else f'<limit lower="{-reach}" upper="{reach}" effort="1" velocity="1"/>'
        lines.append(f'<link name="link_{child}">{INERTIA}</link>')
        lines.append(
            f'<joint name="joint_{child}" type="{kind}"><parent link="link_{parent}"/><child link="link_{child}"/>'
            f'<origin xyz="{_vector(random.uniform(-0.5, 0.5, 3))}" rpy="{_vector(random.uniform(-1.5, 1.5, 3))}"/>'
            f'<axis xyz="{_vector(axis / np.linalg.norm(axis))}"/>{limit}</joint>'
        )
    return "\n".join([*lines, "</robot>"])


def _closures(path, joints, posture, random, count):
    """Frames and constraints; those of loops join links with at least one joint between them."""
    model = pin.buildModelFromUrdf(str(path))
    data, q = model.createData(), pin.neutral(model)
    for child, *_ in joints:  # a continuous joint has (cos, sin) in Pinocchio
        joint = model.joints[model.getJointId(f"joint_{child}")]
        angle = posture[child - 1]
        q[joint.idx_q : joint.idx_q + joint.nq] = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
    pin.framesForwardKinematics(model, data, q)
    place = [data.oMf[model.getFrameId(f"link_{k}")] for k in range(count + 1)]
    frames, constraints = {}, []

    def frame(name, link, there):
        local = place[link].actInv(there)
        rpy = Rotation.from_matrix(local.rotation).as_euler("xyz")
        frames[name] = {"link": f"link_{link}", "xyz": local.translation.tolist(), "rpy": rpy.tolist()}
        return name

    for k in range(int(random.integers(1, 4))):
        kind = str(random.choice(["point", "hinge", "weld", "distance", "coupling"], p=[0.35, 0.2, 0.2, 0.15, 0.1]))
        if kind == "coupling":
            a, b = (int(x) for x in random.choice(count, 2, replace=False))
            ratio = float(random.uniform(0.5, 2.0))
            offset = float(posture[b] - ratio * posture[a])
            entry = {"joint_a": f"joint_{a + 1}", "joint_b": f"joint_{b + 1}", "ratio": ratio, "offset": offset}
        else:
            a, b = (int(x) for x in random.choice(count + 1, 2, replace=False))
            where = pin.SE3(Rotation.random(random_state=random).as_matrix(), random.uniform(-1.0, 1.0, 3))
            other = where
            entry = {}
            if kind == "distance":
                way = random.normal(size=3) * 0.4
                other = pin.SE3(where.rotation, where.translation + way)
                entry["length"] = float(np.linalg.norm(way))
            entry |= {"frame_a": frame(f"a_{k}", a, where), "frame_b": frame(f"b_{k}", b, other)}
        constraints.append({"name": f"loop_{k}", "kind": kind, **entry})
    return {"frames": frames, "constraints": constraints}
