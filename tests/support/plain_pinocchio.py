"""A robot by plain Pinocchio: its URDF as Pinocchio reads it, with payloads, rotors and mimicking joints added by hand.

Nothing of bellcrank has a part in it but the names and places of coordinates: a position q and velocity v are those of
a `bc.Robot`, in the model every joint is one of its own, and continuous joints have (cos, sin).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass
class PlainRobot:
    """Dynamics of one state at a time; the options are those of `bc.load_robot`, friction apart."""

    robot: Any  # a bc.Robot, for the places of its joints in q and v
    path: Path
    gravity: Sequence[float] = (0.0, 0.0, -9.81)
    floating_base: bool = False
    payloads: Sequence[Any] = ()
    rotor_inertia: Mapping[str, float] = field(default_factory=dict)
    frames: Mapping[str, tuple[str, Sequence[float], Sequence[float]]] = field(default_factory=dict)
    model: Any = None  # a pin.Model in place of the URDF's, for joints that Pinocchio's reader does not know

    def __post_init__(self) -> None:
        root = [pin.JointModelFreeFlyer()] if self.floating_base else []
        self.model = model = self.model or pin.buildModelFromUrdf(str(self.path), *root)
        model.gravity.linear = np.array(self.gravity)
        for name, (link, xyz, rpy) in self.frames.items():
            carrier = model.frames[self._body(link)]
            placement = carrier.placement * pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz))
            model.addFrame(pin.Frame(name, carrier.parentJoint, placement, pin.FrameType.OP_FRAME))
        for load in self.payloads:
            frame = model.frames[model.getFrameId(load.frame)]
            body = pin.Inertia(load.mass, np.array(load.cg), _symmetric(*load.inertia))
            model.appendBodyToJoint(frame.parentJoint, body, frame.placement)
        self.data = model.createData()
        self.rotors = np.zeros(self.robot.nv)
        for name, inertia in self.rotor_inertia.items():
            joint = self.robot.joint(name)
            self.rotors[joint.v : joint.v + joint.nv] = inertia
        self._couple()

    def bodies(self) -> dict[str, tuple[str, float, Array, Array]]:
        """By link or payload: its frame, mass, centre of mass and inertia about it, both in the axes of the frame."""
        found: dict[str, tuple[str, float, Array, Array]] = {}
        for link in ElementTree.parse(self.path).getroot().iter("link"):
            if (own := link.find("inertial")) is not None:
                place = own.find("origin")
                xyz, rpy = ("0 0 0", "0 0 0") if place is None else (place.get(k, "0 0 0") for k in ("xyz", "rpy"))
                centre, turn = (np.array(text.split(), dtype=float) for text in (xyz, rpy))
                axes, entry = pin.rpy.rpyToMatrix(*turn), own.find("inertia").attrib
                about = _symmetric(*(float(entry[key]) for key in ("ixx", "ixy", "iyy", "ixz", "iyz", "izz")))
                name, mass = str(link.get("name")), float(own.find("mass").get("value"))
                found[name] = (name, mass, centre, axes @ about @ axes.T)
        for k, load in enumerate(self.payloads):
            found[f"payload {k + 1}"] = (load.frame, load.mass, np.array(load.cg), _symmetric(*load.inertia))
        return found

    def _body(self, link: str) -> int:
        return int(self.model.getFrameId(link, pin.FrameType.BODY))

    def _couple(self) -> None:
        """self.map (model's nv, nv): the velocities of all joints by those of the independent ones."""
        mimics = {}
        for joint in ElementTree.parse(self.path).getroot().iter("joint"):
            found = joint.find("mimic")
            if found is not None:
                follows = float(found.get("multiplier", 1.0)), float(found.get("offset", 0.0))
                mimics[joint.get("name")] = (found.get("joint"), *follows)
        model, places = self.model, {joint.name: joint for joint in self.robot.joints}
        self.map, self.offsets = np.zeros((model.nv, self.robot.nv)), np.zeros(model.nv)
        self._copies = []  # (first in the model's q, first in q, how many, ratio, offset)
        for k in range(1, model.njoints):
            name, ratio, offset = str(model.names[k]), 1.0, 0.0
            while name in mimics:
                leader, multiplier, shift = mimics[name]
                name, ratio, offset = leader, ratio * multiplier, ratio * shift + offset
            own, first = places[name], model.idx_vs[k]
            self.map[first : first + model.nvs[k], own.v : own.v + own.nv] = ratio * np.eye(own.nv)
            self._copies.append((model.idx_qs[k], own.q, model.nqs[k], own.nq, ratio, offset))

    # ---- coordinates

    def position(self, q: Array) -> Array:
        """The model's position."""
        found = np.zeros(self.model.nq)
        for first, own, many, count, ratio, offset in self._copies:
            if count == 1:
                angle = ratio * q[own] + offset
                found[first : first + many] = [angle] if many == 1 else [np.cos(angle), np.sin(angle)]
            else:
                found[first : first + many] = q[own : own + count]
        return found

    def displaced(self, q: Array, step: Array) -> Array:
        """q ⊕ step, in the robot's coordinates."""
        moved, found = pin.integrate(self.model, self.position(q), self.map @ step), np.array(q, dtype=float)
        for joint in self.robot.joints:
            if joint.nq == 1:
                found[joint.q] += step[joint.v]
            else:
                first = self.model.idx_qs[self.model.getJointId(joint.name)]
                found[joint.q : joint.q + joint.nq] = moved[first : first + joint.nq]
        return found

    # ---- dynamics, without friction

    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> Array:
        torque = pin.rnea(self.model, self.data, self.position(q), self.map @ v, self.map @ a)
        return np.asarray(self.map.T @ torque + self.rotors * a)

    def gravity_torque(self, q: Array) -> Array:
        return np.asarray(self.map.T @ pin.computeGeneralizedGravity(self.model, self.data, self.position(q)))

    def mass_matrix(self, q: Array) -> Array:
        upper = np.triu(pin.crba(self.model, self.data, self.position(q)))
        return np.asarray(self.map.T @ (upper + np.triu(upper, 1).T) @ self.map + np.diag(self.rotors))

    def forward_dynamics(self, q: Array, v: Array, torque: Array) -> Array:
        bias = self.inverse_dynamics(q, v, np.zeros_like(v))
        return np.linalg.solve(self.mass_matrix(q), torque - bias)

    def energy(self, q: Array, v: Array) -> tuple[float, float]:
        potential = pin.computePotentialEnergy(self.model, self.data, self.position(q))
        return 0.5 * float(v @ self.mass_matrix(q) @ v), float(potential)

    def reactions(self, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """Force and moment on the child link of each joint, in its frame."""
        pin.rnea(self.model, self.data, self.position(q), self.map @ v, self.map @ a)
        return {str(self.model.names[k]): np.array(self.data.f[k].vector) for k in range(1, self.model.njoints)}

    # ---- kinematics

    def frame(self, name: str, q: Array, v: Array | None = None, a: Array | None = None) -> dict[str, Array]:
        """Position, rotation, and linear and angular velocity and acceleration of a frame, in the world's axes."""
        v = np.zeros(self.robot.nv) if v is None else v
        a = np.zeros(self.robot.nv) if a is None else a
        model, data, axes = self.model, self.data, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        pin.forwardKinematics(model, data, self.position(q), self.map @ v, self.map @ a)
        pin.updateFramePlacements(model, data)
        body = model.existFrame(name, pin.FrameType.BODY)  # a link comes before a joint of its name
        index = self._body(name) if body else model.getFrameId(name)
        speed = pin.getFrameVelocity(model, data, index, axes)
        growth = pin.getFrameClassicalAcceleration(model, data, index, axes)
        return {
            "position": np.array(data.oMf[index].translation), "rotation": np.array(data.oMf[index].rotation),
            "velocity": np.array(speed.linear), "spin": np.array(speed.angular),
            "acceleration": np.array(growth.linear), "spin_up": np.array(growth.angular),
        }  # fmt: skip


def _symmetric(xx: float, xy: float, yy: float, xz: float, yz: float, zz: float) -> Array:
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
