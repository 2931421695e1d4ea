"""The equations of motion of a scene by Pinocchio's algorithms and NumPy: nothing of them is bellcrank's own.

A scene's mapping (`scene.data`) gives forces, controllers and constraints; numbers are in SI units. The model of
Pinocchio is that of the robot. Formulas are those of docs/theory and of the reference of the YAML keys.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin
from plain_pinocchio import PlainRobot
from scipy.integrate import solve_ivp

WORLD_AXES = pin.LOCAL_WORLD_ALIGNED


@dataclass(frozen=True)
class FrameMotion:
    """A frame in world axes; `drift` and `angular_drift` are accelerations where all joint accelerations are 0."""

    position: np.ndarray
    rotation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    drift: np.ndarray
    angular_drift: np.ndarray
    jacobian: np.ndarray  # (6, nv): velocity, then angular velocity


FIXED = FrameMotion(np.zeros(3), np.eye(3), *(np.zeros(3) for _ in range(4)), np.zeros((6, 0)))


def number(given):
    """A number, or an angle such as "25 deg", in SI units."""
    return np.radians(float(given.removesuffix("deg"))) if isinstance(given, str) else given


class PlainDynamics:
    """M v̇ = f + Jᵀ λ with J v̇ = −γ, at one state at a time."""

    def __init__(self, scene, tables=None):
        """`tables` are torques as functions of time, by the file that an entry names."""
        self.scene_data, self.tables, robot = scene.data, tables or {}, scene.robot
        self.robot, self.joints = robot, {joint.name: joint for joint in robot.joints}
        frames = {
            name: (entry["link"], entry.get("xyz", (0, 0, 0)), entry.get("rpy", (0, 0, 0)))
            for name, entry in scene.data.get("frames", {}).items()
        }
        rotors = {name: robot.rotor_inertia[robot.joint(name).v] for name in robot.joint_names}
        self.tree = PlainRobot(robot, robot.source, robot.gravity, robot.floating_base, robot.payloads, rotors, frames)
        self.nq, self.nv = robot.nq, robot.nv
        self.data = self.tree.model.createData()

    # ---- the tree

    def at(self, t, q, v):
        """Set the state."""
        self.t, self.q, self.v = t, q, v
        model, data, still = self.tree.model, self.data, np.zeros(self.tree.model.nv)
        own = self.tree.position(q)
        pin.forwardKinematics(model, data, own, self.tree.map @ v, still)
        pin.updateFramePlacements(model, data)
        pin.computeJointJacobians(model, data, own)
        self.frames = {}
        return self

    def frame(self, name):
        """A frame of the robot, or "world"."""
        if name == "world":
            return FIXED
        if name not in self.frames:
            self.frames[name] = self._frame(name)
        return self.frames[name]

    def _frame(self, name):
        model, data = self.tree.model, self.data
        link = model.existFrame(name, pin.FrameType.BODY)  # a link comes before a joint of its name
        number = model.getFrameId(name, pin.FrameType.BODY) if link else model.getFrameId(name)
        placement = data.oMf[number]
        twist = pin.getFrameVelocity(model, data, number, WORLD_AXES)
        drift = pin.getFrameClassicalAcceleration(model, data, number, WORLD_AXES)
        jacobian = pin.getFrameJacobian(model, data, number, WORLD_AXES) @ self.tree.map
        return FrameMotion(
            placement.translation.copy(), placement.rotation.copy(), twist.linear.copy(), twist.angular.copy(),
            drift.linear.copy(), drift.angular.copy(), jacobian,
        )  # fmt: skip

    def mass_matrix(self):
        """M (nv, nv)."""
        return self.tree.mass_matrix(self.q)

    def position_rate(self):
        """q̇ (nq,): v, and for a free body its velocity in the world and ½ p ∘ (ω, 0)."""
        q, v, rate = self.q, self.v, np.zeros(self.nq)
        for joint in self.joints.values():
            if joint.nq == joint.nv == 1:
                rate[joint.q] = v[joint.v]
                continue
            assert joint.kind == "floating"
            x, y, z, w = q[joint.q + 3 : joint.q + 7]
            wx, wy, wz = v[joint.v + 3 : joint.v + 6]
            turn = pin.Quaternion(w, x, y, z).toRotationMatrix()
            rate[joint.q : joint.q + 3] = turn @ v[joint.v : joint.v + 3]
            rate[joint.q + 3 : joint.q + 7] = 0.5 * np.array(
                [
                    w * wx + y * wz - z * wy,
                    w * wy + z * wx - x * wz,
                    w * wz + x * wy - y * wx,
                    -x * wx - y * wy - z * wz,
                ]
            )
        return rate

    # ---- forces

    def friction(self):
        """The robot's own friction (nv,): what the joints lose."""
        robot, v = self.robot, self.v
        return -robot.viscous * v - robot.coulomb * v / np.sqrt(v**2 + 1e-3**2)

    def of_joint(self, name, torque):
        """A generalised force (nv,) at one joint."""
        force = np.zeros(self.nv)
        force[self.joints[name].v] = torque
        return force

    def force(self, entry):
        """(generalised force, potential energy, what an output of it shows) of an entry of `forces`."""
        return getattr(self, "_" + entry["kind"])(entry)

    def _coordinate(self, entry):
        joint = self.joints[entry["joint"]]
        return self.q[joint.q], self.v[joint.v]

    def _joint_spring(self, entry):
        angle, rate = self._coordinate(entry)
        stretch, preload = angle - entry.get("rest", 0.0), entry.get("preload", 0.0)
        torque = -entry["stiffness"] * stretch + preload - entry.get("damping", 0.0) * rate
        energy = 0.5 * entry["stiffness"] * stretch**2 - preload * angle
        return self.of_joint(entry["joint"], torque), energy, torque

    def _damper(self, entry):
        torque = -entry["coefficient"] * self._coordinate(entry)[1]
        return self.of_joint(entry["joint"], torque), 0.0, torque

    def _friction(self, entry):
        rate = self._coordinate(entry)[1]
        torque = -entry.get("viscous", 0.0) * rate
        torque -= entry.get("coulomb", 0.0) * rate / np.hypot(rate, entry.get("width", 1e-3))
        return self.of_joint(entry["joint"], torque), 0.0, torque

    def _torque(self, entry):
        torque = entry["value"] if "value" in entry else self.tables[entry["file"]](self.t)
        return self.of_joint(entry["joint"], torque), 0.0, torque

    def _spring(self, entry):
        a, b = self.frame(entry["frame_a"]), self.frame(entry["frame_b"])
        way = b.position + np.array(entry.get("point", (0.0, 0.0, 0.0))) - a.position
        length = np.linalg.norm(way)
        along = way / length
        stretch = length - entry.get("free_length", 0.0)
        rate = along @ (b.velocity - a.velocity)
        tension = entry["stiffness"] * stretch + entry.get("damping", 0.0) * rate
        force = tension * (along @ a.jacobian[:3])
        if entry["frame_b"] != "world":
            force = force - tension * (along @ b.jacobian[:3])
        return force, 0.5 * entry["stiffness"] * stretch**2, tension

    def _wrench(self, entry):
        frame, none = self.frame(entry["frame"]), (0.0, 0.0, 0.0)
        turn = frame.rotation if entry.get("expressed_in") == "frame" else np.eye(3)
        wrench = np.hstack([turn @ entry.get("force", none), turn @ entry.get("torque", none)])
        return frame.jacobian.T @ wrench, 0.0, wrench

    # ---- controllers

    def control(self, entry):
        """The torques (nv,) of a controller."""
        torque = getattr(self, "_" + entry["kind"])(entry)
        if "limit" not in entry:
            return torque
        most = self.robot.effort_limit if entry["limit"] == "effort" else entry["limit"]
        return np.clip(torque, -most, most)

    def _names(self, entry):
        chosen = entry.get("joints", [entry["joint"]] if "joint" in entry else "all")
        return [name for name, joint in self.joints.items() if joint.nv == 1] if chosen == "all" else chosen

    def _pd(self, entry):
        torque = np.zeros(self.nv)
        for name in entry["target"]:
            angle, rate = self._coordinate({"joint": name})
            gains = [entry.get(key, 0.0) for key in ("kp", "kd")]
            kp, kd = (gain[name] if isinstance(gain, dict) else gain for gain in gains)
            torque[self.joints[name].v] = kp * (number(entry["target"][name]) - angle) - kd * rate
        return torque

    def _gravity_compensation(self, entry):
        weight = self.tree.gravity_torque(self.q) * (1.0 + entry.get("mass_error", 0.0))
        places = [self.joints[name].v for name in self._names(entry)]
        torque = np.zeros(self.nv)
        torque[places] = weight[places]
        return torque

    def actuators(self):
        """The torques (nv,) of motors and controllers."""
        forces = [self.force(e)[0] for e in self.scene_data.get("forces", ()) if e["kind"] == "torque"]
        return sum(forces + [self.control(e) for e in self.scene_data.get("control", ())], np.zeros(self.nv))

    def passive(self):
        """The generalised force (nv,) of springs, dampers, friction elements and wrenches."""
        forces = [self.force(e)[0] for e in self.scene_data.get("forces", ()) if e["kind"] != "torque"]
        return sum(forces, np.zeros(self.nv))

    def energies(self):
        """Kinetic and potential energy, J."""
        kinetic, weight = self.tree.energy(self.q, self.v)
        return kinetic, weight + sum(self.force(entry)[1] for entry in self.scene_data.get("forces", ()))

    def power(self):
        """The power of everything that has no potential, W; springs only lose it in their dampers."""
        lost = 0.0
        for entry in self.scene_data.get("forces", ()):
            force = self.force(entry)[0]
            if entry["kind"] in ("spring", "joint_spring"):
                force = force - self.force({**entry, "damping": 0.0})[0]
            lost += force @ self.v
        controllers = sum(self.control(entry) @ self.v for entry in self.scene_data.get("control", ()))
        return lost + controllers + self.friction() @ self.v

    # ---- constraints

    def constraint(self, entry):
        """J (rows, nv) and γ (rows,) of an entry of `constraints`: J v̇ = −γ."""
        return getattr(self, "_" + entry["kind"])(entry)

    def _point(self, entry):
        a, b = self.frame(entry["frame_a"]), self.frame(entry["frame_b"])
        away = 0.0 if entry["frame_b"] == "world" else b.jacobian[:3]
        return a.jacobian[:3] - away, a.drift - b.drift

    def _distance(self, entry):
        a, b = self.frame(entry["frame_a"]), self.frame(entry["frame_b"])
        way, rate = (a.position - b.position) / entry["length"], (a.velocity - b.velocity) / entry["length"]
        row = way @ (a.jacobian[:3] - b.jacobian[:3])
        gamma = way @ (a.drift - b.drift) + rate @ (a.velocity - b.velocity)
        return row[None, :], np.array([gamma])

    def _rolling_disk(self, entry):
        disk, radius = self.frame(entry["frame"]), entry["radius"]
        n = np.array(entry.get("normal", (0.0, 0.0, 1.0)))
        a = disk.rotation @ np.array(entry.get("axis", (0.0, 1.0, 0.0)))
        turn, turning = disk.angular_velocity, disk.angular_drift
        a1 = np.cross(turn, a)
        a2 = np.cross(turning, a) + np.cross(turn, a1)
        w, w1, w2 = (np.cross(each, n) for each in (a, a1, a2))
        s = np.linalg.norm(w)
        s1 = w @ w1 / s
        s2 = (w1 @ w1 + w @ w2) / s - (w @ w1) ** 2 / s**3
        f, f1 = w / s, w1 / s - w * s1 / s**2
        linear, angular = disk.jacobian[:3], disk.jacobian[3:]
        rise = np.cross(a, np.cross(n, f))  # s' = f·((ω × a) × n) = ω·(a × (n × f))
        rows = np.array(
            [n @ linear - radius * rise @ angular, f @ linear - radius * a @ angular,
             np.cross(n, f) @ linear + radius * s * f @ angular]
        )  # fmt: skip
        gamma = np.array(
            [
                n @ disk.drift - radius * s2,
                f @ disk.drift + f1 @ disk.velocity - radius * (a @ turning),
                np.cross(n, f) @ disk.drift
                + np.cross(n, f1) @ disk.velocity
                + radius * (s1 * f @ turn + s * f @ turning + s * f1 @ turn),
            ]
        )
        return rows, gamma

    def jacobian(self):
        """J (rows, nv) and γ (rows,) of all constraints in their order."""
        found = [self.constraint(entry) for entry in self.scene_data["constraints"]]
        return np.vstack([each[0] for each in found]), np.hstack([each[1] for each in found])

    def gap(self, entry):
        """φ of an entry of `constraints`, m."""
        if entry["kind"] == "rolling_disk":
            disk, n = self.frame(entry["frame"]), np.array(entry.get("normal", (0.0, 0.0, 1.0)))
            steepness = np.linalg.norm(np.cross(disk.rotation @ np.array(entry.get("axis", (0.0, 1.0, 0.0))), n))
            return np.array([n @ disk.position - entry.get("height", 0.0) - entry["radius"] * steepness])
        way = self.frame(entry["frame_a"]).position - self.frame(entry["frame_b"]).position
        if entry["kind"] == "point":
            return way
        return np.array([(way @ way - entry["length"] ** 2) / (2 * entry["length"])])

    # ---- the motion

    def rows(self, run):
        """Quantities in all rows of a run, as arrays by name; forces and controllers by "force NAME"."""
        found = [self._row(*row) for row in zip(run.time, run.position, run.velocity, strict=True)]
        return {name: np.array([row[name] for row in found]) for name in found[0]}

    def _row(self, t, q, v):
        self.at(t, q, v)
        acceleration, multipliers = self.accelerations()
        kinetic, potential = self.energies()
        actuators = self.actuators()
        row = {
            "acceleration": acceleration, "multipliers": multipliers, "kinetic": kinetic, "potential": potential,
            "actuators": actuators, "torque": actuators + self.passive() + self.friction(), "power": self.power(),
        }  # fmt: skip
        for entry in self.scene_data.get("forces", ()):
            row[f"force {entry['name']}"] = self.force(entry)[2]
        for entry in self.scene_data.get("control", ()):
            names = list(entry["target"]) if "target" in entry else self._names(entry)
            row[f"force {entry['name']}"] = self.control(entry)[[self.joints[name].v for name in names]]
        return row

    def accelerations(self):
        """v̇ (nv,) and the multipliers of all rows of the constraints, of least norm where they are not unique."""
        force = self.actuators() + self.passive() + self.friction()
        force -= self.tree.inverse_dynamics(self.q, self.v, np.zeros(self.nv))
        inverse = np.linalg.inv(self.mass_matrix())
        free = inverse @ force
        if not self.scene_data.get("constraints"):
            return free, np.zeros(0)
        rows, gamma = self.jacobian()
        multipliers = np.linalg.pinv(rows @ inverse @ rows.T, rcond=1e-10, hermitian=True) @ (-gamma - rows @ free)
        return free + inverse @ rows.T @ multipliers, multipliers

    def rate(self, t, x):
        """d(q, v, W)/dt, for an integrator."""
        self.at(t, x[: self.nq], x[self.nq : self.nq + self.nv])
        return np.hstack([self.position_rate(), self.accelerations()[0], self.power()])

    def solution(self, q, v, stops):
        """(q, v, W) as a function of time, by SciPy from q, v at stops[0]; at the others SciPy begins anew."""
        state, parts = np.hstack([q, v, 0.0]), []
        for first, last in pairwise(stops):
            found = solve_ivp(self.rate, (first, last), state, "DOP853", rtol=1e-11, atol=1e-12, dense_output=True)
            state = found.y[:, -1]
            parts.append(found.sol)

        def at(time):
            part = parts[min(np.searchsorted(stops, time, "right"), len(parts)) - 1]
            return part(time)

        return at
