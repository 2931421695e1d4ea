"""Loads of a scene's motors along motions by plain Pinocchio and NumPy, which sizings and selections are compared with.

At each time S τ + Jᵀ λ = f, with the forces f that the motion takes, the motors' torques τ and the multipliers λ of the
constraints. With the velocities B of all joints by those of the motors, J B = 0 and Sᵀ B = 1, so τ = Bᵀ f.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin
from plain_dynamics import PlainDynamics


class PlainLoads:
    """Loads of the motors at some joints; rotors do not count, since actuators have them.

    `bodies` are those of actuators by joint: mass, inertia about the axis and across it; `mounts` are as in a scene.
    """

    def __init__(self, scene, motors, bodies=None, mounts=None):
        self.plain = PlainDynamics(scene)
        self.robot, self.tree = self.plain.robot, self.plain.tree
        self.tree.rotors[:] = 0.0
        model = self.tree.model
        for name, body in (bodies or {}).items():
            self._carry(name, np.array(body), (mounts or {}).get(name, {}))
        self.tree.data, self.plain.data = model.createData(), model.createData()
        self.joints = [self.robot.joint(name) for name in motors]
        self.columns, self.places = ([getattr(joint, key) for joint in self.joints] for key in "vq")
        self.motors = np.eye(self.robot.nv)[:, self.columns]  # S
        self.constraints = scene.data.get("constraints", ())
        self.forces = scene.data.get("forces", ())

    def _carry(self, name, body, mount):
        """Fix the body of a joint's actuator to its mount, less what of it is there already."""
        model = self.tree.model
        joint = model.getJointId(name)
        included = [mount.get(f"included_{key}", 0.0) for key in ("mass", "axial_inertia", "transverse_inertia")]
        mass, along, across = body - included
        if mass == along == across == 0.0:
            return
        carrier, place, axis = model.parents[joint], model.jointPlacements[joint], self._axis(joint)
        if "link" in mount:
            frame = model.frames[model.getFrameId(mount["link"], pin.FrameType.BODY)]
            carrier, place, axis = frame.parentJoint, frame.placement, np.array([0.0, 0.0, 1.0])
        if "axis" in mount:
            axis = np.array(mount["axis"]) / np.linalg.norm(mount["axis"])
        inertia = across * np.eye(3) + (along - across) * np.outer(axis, axis)
        model.appendBodyToJoint(carrier, pin.Inertia(mass, np.zeros(3), inertia), place)

    def at(self, t, q, v, a):
        """The loads at one time, by name."""
        plain, model = self.plain.at(t, q, v), self.tree.model
        friction = -plain.friction()
        for entry in self.forces:
            if entry["kind"] == "friction":
                friction = friction - plain.force(entry)[0]
        acting = sum((plain.force(entry)[0] for entry in self.forces), np.zeros(plain.nv))
        needed = self.tree.inverse_dynamics(q, v, a) - acting - plain.friction()
        rows = [plain.constraint(entry)[0] for entry in self.constraints]
        jacobian = np.vstack([np.zeros((0, plain.nv)), *rows])
        moved = np.vstack([jacobian, self.motors.T])
        B = np.linalg.lstsq(moved, np.eye(len(moved))[:, len(jacobian) :], rcond=1e-10)[0]
        torque = B.T @ needed
        multipliers = np.linalg.lstsq(jacobian.T, needed - self.motors @ torque, rcond=1e-10)[0]
        assert np.abs(jacobian.T @ multipliers + self.motors @ torque - needed).max() <= 1e-8 * np.abs(needed).max()
        wrenches = self._wrenches(q, v, a, multipliers)
        names = [str(name) for name in model.names]
        bearing, tilting, axial = np.zeros((3, len(self.joints)))
        for k, joint in enumerate(self.joints):
            force, moment = wrenches[joint.name][:3].copy(), wrenches[joint.name][3:].copy()
            axis = self._axis(names.index(joint.name))
            axial[k] = abs(force @ axis)
            part = force if joint.kind == "prismatic" else moment
            part -= (part @ axis) * axis
            bearing[k], tilting[k] = np.linalg.norm(force), np.linalg.norm(moment)
        return {
            "torque": torque, "multipliers": multipliers, "friction": B.T @ friction, "bearing": bearing,
            "axial": axial, "tilting": tilting, "inertia": np.diag(B.T @ self.tree.mass_matrix(q) @ B),
            "wrenches": wrenches, "map": B,
        }  # fmt: skip

    def held(self, q, t=0.0):
        """The static torques of the motors."""
        return self.at(t, q, np.zeros(self.robot.nv), np.zeros(self.robot.nv))["torque"]

    def resistance(self, t, q, v, a):
        """The part of the motors' torques that changes its sign with the velocities."""
        B, lost = self.at(t, q, v, a)["map"], []
        for way in (1.0, -1.0):
            self.plain.at(t, q, way * v)
            acting = sum((self.plain.force(entry)[0] for entry in self.forces), np.zeros(self.plain.nv))
            lost.append(-acting - self.plain.friction())
        return B.T @ (lost[0] - lost[1]) * 0.5

    def link_shares(self, q, v, a):
        """The part (links, k) of the motors' torques that the mass and inertia of each link or payload cause."""
        tree, B = self.tree, self.at(0.0, q, v, a)["map"]
        states = tree.position(q), tree.map @ v, tree.map @ a
        return np.array([pin.rnea(model, model.createData(), *states) @ tree.map @ B for model in self._alone])

    @cached_property
    def _alone(self):
        """Models in which one link or payload alone has mass."""
        found = []
        for name, mass, centre, inertia in self.tree.bodies().values():
            model = self.tree.model.copy()
            for k in range(model.njoints):
                model.inertias[k] = pin.Inertia.Zero()
            body = model.existFrame(name, pin.FrameType.BODY)
            frame = model.frames[model.getFrameId(name, pin.FrameType.BODY) if body else model.getFrameId(name)]
            model.appendBodyToJoint(frame.parentJoint, pin.Inertia(mass, centre, inertia), frame.placement)
            found.append(model)
        return found

    def shown_multipliers(self, multipliers):
        """Those (n, m) that a planar linkage has too: the force of a point along z does nothing there."""
        planar = [entry["kind"] == "point" for entry in self.constraints]
        return multipliers[:, :2] if planar == [True] else multipliers

    def along(self, motion, nodes=60):
        """The loads at the nodes of an integration over a motion."""
        time, weight = integration_nodes(motion, nodes)
        q, v, a = motion.at(time)
        rows = [self.at(*state) for state in zip(time, q, v, a, strict=True)]
        found = {key: np.array([row[key] for row in rows]) for key in rows[0] if key not in ("wrenches", "map")}
        found["structure"] = self._structure(rows)
        return Along(motion, time, weight, q[:, self.places], v[:, self.columns], a[:, self.columns], found)

    # ---- reactions

    def _structure(self, rows):
        """(force, moment) over time of each constraint and joint without a motor."""
        found, first = {}, 0
        for entry in self.constraints:
            count = len(self.plain.constraint(entry)[0])
            size = np.linalg.norm([row["multipliers"][first : first + count] for row in rows], axis=1)
            found[entry["name"]], first = (size, None), first + count
        motors = {joint.name for joint in self.joints}
        for name in self.robot.all_joint_names:
            if name not in motors:
                wrench = np.array([row["wrenches"][name] for row in rows])
                found[name] = np.linalg.norm(wrench[:, :3], axis=1), np.linalg.norm(wrench[:, 3:], axis=1)
        return found

    def _wrenches(self, q, v, a, multipliers):
        """Force and moment on the child link of each joint, in its frame, with the forces on frames."""
        tree, model, data = self.tree, self.tree.model, self.tree.data
        pushed = [pin.Force.Zero() for _ in range(model.njoints)]
        placements = self.plain.data.oMi
        for name, force, moment in self._pushes(multipliers):
            link = model.existFrame(name, pin.FrameType.BODY)
            frame = model.getFrameId(name, pin.FrameType.BODY) if link else model.getFrameId(name)
            joint = model.frames[frame].parentJoint
            place = placements[joint]
            arm = self.plain.frame(name).position - place.translation
            turned = place.rotation.T
            pushed[joint] += pin.Force(turned @ force, turned @ (moment + np.cross(arm, force)))
        pin.rnea(model, data, tree.position(q), tree.map @ v, tree.map @ a, pushed)
        return {str(model.names[k]): np.array(data.f[k].vector) for k in range(1, model.njoints)}

    def _pushes(self, multipliers):
        """(frame, force, moment) in the world's axes of constraints, springs between frames and wrenches."""
        none, first = np.zeros(3), 0
        for entry in self.constraints:
            if entry["kind"] == "point":
                force, used = multipliers[first : first + 3], 3
            else:
                a, b = (self.plain.frame(entry[key]).position for key in ("frame_a", "frame_b"))
                force, used = multipliers[first] * (a - b) / entry["length"], 1
            yield entry["frame_a"], force, none
            yield entry["frame_b"], -force, none
            first += used
        for entry in self.forces:
            if entry["kind"] == "wrench":
                wrench = self.plain.force(entry)[2]
                yield entry["frame"], wrench[:3], wrench[3:]
            elif entry["kind"] == "spring":
                a, b = (self.plain.frame(entry[key]).position for key in ("frame_a", "frame_b"))
                way = b + np.array(entry.get("point", (0.0, 0.0, 0.0))) - a
                force = self.plain.force(entry)[2] * way / np.linalg.norm(way)
                yield entry["frame_a"], force, none
                if entry["frame_b"] != "world":
                    yield entry["frame_b"], -force, none

    def _axis(self, joint):
        """The axis of a joint in its own frame."""
        model = self.tree.model
        motion = model.joints[joint].createData()
        model.joints[joint].calc(motion, pin.neutral(model))
        column = np.array(motion.S).reshape(6, -1)[:, 0]
        return column[:3] if np.any(column[:3]) else column[3:]


@dataclass
class Along:
    """Loads of k motors at n times of a motion, whose sums with `weight` are integrals; arrays (n, k)."""

    motion: object
    time: np.ndarray
    weight: np.ndarray
    position: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    found: dict

    def __getattr__(self, name):
        return self.found[name]

    def integral(self, values):
        """Over the motion."""
        return self.weight @ values

    def rms(self, values):
        """Over the motion."""
        return np.sqrt(self.integral(values**2) / self.weight.sum())


def integration_nodes(motion, count):
    """Times and weights of Gauss's rule between rows and reversals, denser towards both of these."""
    edges = np.unique(np.concatenate([motion.time, _reversals(motion)]))
    edges = edges[np.concatenate([[True], np.diff(edges) > 1e-9])]
    x, w = np.polynomial.legendre.leggauss(max(8, round(count / len(edges)) * 2))
    share, part = 0.5 - 0.5 * np.sin(0.5 * np.pi * x), 0.25 * np.pi * np.cos(0.5 * np.pi * x) * w
    length = np.diff(edges)[:, None]
    time = (edges[:-1, None] + length * share[::-1]).ravel()
    return time, (length * part[::-1]).ravel()


def _reversals(motion):
    """Times at which a joint turns around."""
    time = np.unique(np.concatenate([np.linspace(motion.time[0], motion.time[-1], 401), motion.time]))
    speed = motion.at(time)[1]
    row, column = np.nonzero(speed[:-1] * speed[1:] < 0.0)
    low, high = time[row], time[row + 1]
    for _ in range(50):
        middle = 0.5 * (low + high)
        same = motion.at(middle)[1][np.arange(len(row)), column] * speed[row, column] > 0.0
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return low
