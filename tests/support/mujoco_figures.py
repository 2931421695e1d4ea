"""What MuJoCo's own loader and dynamics say of an MJCF file: figures to compare with, in bellcrank's coordinates.

Without contacts, limits, dry friction and actuators, and for the accelerations without equality constraints. Run as a
script it writes the figures that the tests compare with where MuJoCo is not installed:
python tests/support/mujoco_figures.py tests/robot/mjcf/*.xml
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np

STORED = Path(__file__).parents[1] / "robot" / "mjcf" / "figures.json"
FREE, BALL = 0, 1  # MuJoCo's numbers of joint types
FEW = 3  # states whose figures are stored


def figures(path: Path, states: int = FEW) -> dict[str, Any]:
    """Bodies: mass, centre of gravity and inertia about it in the body's frame. States: random positions and velocities
    by joint, the accelerations, and what is left open of each constraint.
    """
    import mujoco

    model = mujoco.MjModel.from_xml_string(path.read_text(encoding="utf-8"), _assets(path))
    data = mujoco.MjData(model)
    bit = mujoco.mjtDisableBit
    model.opt.disableflags |= int(
        bit.mjDSBL_CONTACT | bit.mjDSBL_LIMIT | bit.mjDSBL_ACTUATION | bit.mjDSBL_FRICTIONLOSS
    )
    rng = np.random.default_rng(7)
    return {
        "bodies": {model.body(k).name: _body(model, k) for k in range(1, model.nbody) if model.body(k).name},
        "states": [_state(mujoco, model, data, rng) for _ in range(states)],
    }


def _assets(path: Path) -> dict[str, bytes]:
    """The files beside an MJCF file, and a tetrahedron for each mesh: it is drawn and has no part in the figures."""
    meshes = re.findall(r'file="([^"]*[.]obj)"', path.read_text(encoding="utf-8"))
    tetrahedron = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
    return {each.name: each.read_bytes() for each in path.parent.glob("*.xml")} | dict.fromkeys(meshes, tetrahedron)


def _body(model: Any, k: int) -> dict[str, Any]:
    turn = _rotation(model.body_iquat[k])
    inertia = turn @ np.diag(model.body_inertia[k]) @ turn.T
    return {"mass": float(model.body_mass[k]), "center": model.body_ipos[k].tolist(), "inertia": inertia.tolist()}


def _state(mujoco: Any, model: Any, data: Any, rng: np.random.Generator) -> dict[str, Any]:
    position, velocity = rng.uniform(-1.5, 1.5, model.nq), rng.uniform(-2.0, 2.0, model.nv)
    for k in range(model.njnt):
        if model.jnt_type[k] in (FREE, BALL):
            first = model.jnt_qposadr[k] + (3 if model.jnt_type[k] == FREE else 0)
            position[first : first + 4] /= np.linalg.norm(position[first : first + 4])
    data.qpos[:], data.qvel[:] = position, velocity
    flags = model.opt.disableflags
    model.opt.disableflags = flags | int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
    mujoco.mj_forward(model, data)
    acceleration = data.qacc.copy()
    model.opt.disableflags = flags
    mujoco.mj_forward(model, data)
    equality = data.efc_type[: data.nefc] == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    return {
        "position": _by_joint(model, lambda k: _position(model, position, k)),
        "velocity": _by_joint(model, lambda k: _velocity(model, position, velocity, k)),
        "acceleration": _by_joint(model, lambda k: _acceleration(model, position, velocity, acceleration, k)),
        "frames": {model.site(k).name: data.site_xpos[k].tolist() for k in range(model.nsite) if model.site(k).name},
        "gaps": {
            model.equality(k).name: data.efc_pos[: data.nefc][equality & (data.efc_id[: data.nefc] == k)].tolist()
            for k in range(model.neq)
            if model.eq_active0[k]
        },
    }


def _by_joint(model: Any, value: Any) -> dict[str, list[float]]:
    free = {FREE: "free"}
    names = [
        model.joint(k).name or f"{model.body(model.jnt_bodyid[k]).name}_{free.get(int(model.jnt_type[k]), 'slide')}"
        for k in range(model.njnt)
    ]
    return {name: [float(each) for each in value(k)] for k, name in enumerate(names)}


def _position(model: Any, position: Any, k: int) -> list[float]:
    """Lengths and angles as they are, quaternions x y z w instead of w x y z."""
    first, kind = model.jnt_qposadr[k], model.jnt_type[k]
    if kind not in (FREE, BALL):
        return [position[first]]
    at = first + (3 if kind == FREE else 0)
    return [*position[first:at], *np.roll(position[at : at + 4], -1)]


def _velocity(model: Any, position: Any, velocity: Any, k: int) -> list[float]:
    """A free body's linear velocity in its own axes: MuJoCo has it in the world's."""
    own = _part(model, velocity, k)
    return [*(_free_turn(model, position, k).T @ own[:3]), *own[3:]] if len(own) == 6 else list(own)


def _acceleration(model: Any, position: Any, velocity: Any, acceleration: Any, k: int) -> list[float]:
    """The derivative of `_velocity`: d(Rᵀ ẋ)/dt = Rᵀ ẍ − ω × Rᵀ ẋ."""
    own = _part(model, acceleration, k)
    if len(own) != 6:
        return list(own)
    turn, speed = _free_turn(model, position, k), _part(model, velocity, k)
    return [*(turn.T @ own[:3] - np.cross(speed[3:], turn.T @ speed[:3])), *own[3:]]


def _part(model: Any, values: Any, k: int) -> Any:
    first = model.jnt_dofadr[k]
    return values[first : first + {FREE: 6, BALL: 3}.get(int(model.jnt_type[k]), 1)]


def _free_turn(model: Any, position: Any, k: int) -> Any:
    first = model.jnt_qposadr[k]
    return _rotation(position[first + 3 : first + 7])


def _rotation(quaternion: Any) -> Any:
    """The matrix of a unit quaternion w x y z."""
    w, v = quaternion[0], np.asarray(quaternion[1:])
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


if __name__ == "__main__":
    import mujoco

    found: dict[str, Any] = {"source": f"computed by MuJoCo {mujoco.__version__} with tests/support/mujoco_figures.py"}
    for name in sys.argv[1:]:
        found[Path(name).stem] = figures(Path(name))
    lines = [f"{json.dumps(key)}: {json.dumps(each)}" for key, each in found.items()]
    STORED.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
