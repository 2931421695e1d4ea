"""Closed-chain inverse dynamics of parallel robots that others built, against a KKT solution of plain Pinocchio.

From the same files, with nothing of bellcrank but the state and the motors' accelerations: J holds the rows of both
frames of each loop, and the accelerations a, the multipliers λ and the motors' torques τ solve the KKT equations

    M a + h = S τ + Jᵀ λ,    J a = −J̇ v,    Sᵀ a = the motors' accelerations

(Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 8). Where the motors leave rods free to turn about their own
axis, a is not determined by the last two: the first, on the motions Z that they leave, gives Zᵀ (M a + h) = 0. More
motors than freedoms share the load with the least Σ τ². The joints' order and the equations' frames differ from
bellcrank's.

kangaroo_like, the seventh robot of the collection, has no posture in which all of its loops close.
"""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml

import bellcrank as bc
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage

FOLDER = Path(__file__).parent / "parallel_robots"  # BSD-3-Clause, see the LICENSE there
AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def with_joint_types(model, types):
    """The model with joints, by name, of Gepetto's types SPHERICAL and UJOINT_XY (axes x, then y)."""
    found, place = pin.Model(), [0]
    found.gravity = model.gravity
    for k in range(1, model.njoints):
        name, parent, at = model.names[k], place[model.parents[k]], model.jointPlacements[k]
        kind = types.get(name)
        if kind == "SPHERICAL":
            index = found.addJoint(parent, pin.JointModelSpherical(), at, name)
        elif kind == "UJOINT_XY":
            first = found.addJoint(parent, pin.JointModelRX(), at, f"{name}_1")
            index = found.addJoint(first, pin.JointModelRY(), pin.SE3.Identity(), f"{name}_2")
        else:
            index = found.addJoint(parent, model.joints[k], at, name)
        found.inertias[index] = model.inertias[k]
        place.append(index)
    for frame in model.frames[1:]:
        found.addFrame(pin.Frame(frame.name, place[frame.parentJoint], 0, frame.placement, pin.FrameType.OP_FRAME))
    return found


class PinocchioMechanism:
    """The robot of a folder: its tree as Pinocchio reads it, its loops and motors as its YAML lists them."""

    def __init__(self, folder):
        contents = yaml.safe_load((folder / "robot.yaml").read_text())
        model = pin.buildModelFromUrdf(str(folder / "robot.urdf"))
        types = dict(zip(contents.get("joint_name", []), contents.get("joint_type", []), strict=True))
        self.model = with_joint_types(model, types)
        self.data = self.model.createData()
        self.motors = contents["name_mot"]
        self.loops = [
            (self.model.getFrameId(a), self.model.getFrameId(b), 3 if kind.lower() == "3d" else 6)
            for (a, b), kind in zip(contents["closed_loop"], contents["type"], strict=True)
        ]
        self.selection = np.zeros((self.model.nv, len(self.motors)))
        for k, name in enumerate(self.motors):
            self.selection[self.joint(name).idx_v, k] = 1.0

    def joint(self, name):
        return self.model.joints[self.model.getJointId(name)]

    def position(self, joints, values):
        """A position of bellcrank's joints in Pinocchio's order."""
        found = np.empty(self.model.nq)
        for joint in joints:
            place = self.joint(joint.name).idx_q
            found[place : place + joint.nq] = values[joint.q : joint.q + joint.nq]
        return found

    def velocity(self, joints, values):
        """A velocity or acceleration of bellcrank's joints in Pinocchio's order."""
        found = np.empty(self.model.nv)
        for joint in joints:
            place = self.joint(joint.name).idx_v
            found[place : place + joint.nv] = values[joint.v : joint.v + joint.nv]
        return found

    def gap(self, q):
        """The largest distance, m, or angle, rad, between the frames of a loop."""
        pin.framesForwardKinematics(self.model, self.data, q)
        gaps = []
        for a, b, rows in self.loops:
            apart = pin.log6(self.data.oMf[a].actInv(self.data.oMf[b])).vector
            gaps.append(np.abs(apart[:rows]).max())
        return max(gaps)

    def jacobian(self, q):
        """J of all loops: the twist of one frame less that of the other, world axes."""
        pin.computeJointJacobians(self.model, self.data, q)
        pin.updateFramePlacements(self.model, self.data)
        rows = []
        for a, b, count in self.loops:
            first, second = (pin.getFrameJacobian(self.model, self.data, frame, AXES) for frame in (a, b))
            rows.append((first - second)[:count])
        return np.concatenate(rows)

    def drift(self, q, v):
        """J̇ v: the frames' accelerations where all joint accelerations are 0."""
        pin.forwardKinematics(self.model, self.data, q, v, np.zeros_like(v))
        pin.updateFramePlacements(self.model, self.data)
        rows = []
        for a, b, count in self.loops:
            first, second = (
                pin.getFrameClassicalAcceleration(self.model, self.data, frame, AXES).vector for frame in (a, b)
            )
            rows.append((first - second)[:count])
        return np.concatenate(rows)

    def solution(self, q, v, motor_acceleration):
        """(τ, a, the motions Z that the motors leave, residual of the equations of motion) at a closed state."""
        jacobian, select = self.jacobian(q), self.selection
        whole = np.concatenate([jacobian, select.T])
        mass = pin.crba(self.model, self.data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        bias = pin.nonLinearEffects(self.model, self.data, q, v)
        a = solve(whole, np.concatenate([-self.drift(q, v), motor_acceleration]))
        free = null_space(whole)
        if free.shape[1]:
            a = a - free @ np.linalg.solve(free.T @ mass @ free, free.T @ (mass @ a + bias))
        need = mass @ a + bias
        both = np.concatenate([select, jacobian.T], axis=1)
        found = solve(both, need)
        motions = null_space(jacobian).T @ select
        torque = solve(motions, motions @ found[: len(self.motors)])  # of all that fit, the least
        return torque, a, free, need - both @ found


def solve(matrix, right):
    """The least-squares solution of least norm, rank by singular values."""
    return np.linalg.lstsq(matrix, right, rcond=1e-9)[0]


def null_space(matrix):
    """An orthonormal basis, as columns, of the null space."""
    _, values, rows = np.linalg.svd(matrix)
    return rows[int(np.count_nonzero(values > 1e-9 * values[0])) :].T


def swung(name):
    """(linkage, motion): the motors of a robot swing by up to 0.25 rad about the posture where it starts."""
    linkage = Linkage(bc.load_scene(FOLDER / name / "robot.urdf"))
    start = linkage.kinematics.start
    begin = {joint.name: float(start[joint.q]) for joint in linkage.motors}
    swings = np.random.default_rng(7).uniform(-0.25, 0.25, (3, len(begin)))
    there = [{joint: at + float(d) for (joint, at), d in zip(begin.items(), row, strict=True)} for row in swings]
    motion = bc.waypoints(linkage.robot, times=[0, 0.3, 0.7, 1.0], positions=[begin, *there], samples=41)
    return linkage, linkage.along(motion)[0]


ROBOTS = {
    "5bar_linkage": (2, 1),
    "5bar_linkage_iso3d": (2, 0),
    "robot_delta": (2, 3),
    "cassie_like": (5, 2),
    "disney_robot": (10, 4),  # of 12 motors, two depend on the others
    "digit_like_2legs": (12, 0),
}


@pytest.mark.tier2
@pytest.mark.parametrize(("name", "driven", "idle"), [(name, *counts) for name, counts in ROBOTS.items()])
def test_motor_torques_are_those_of_pinocchio_s_kkt_equations(name, driven, idle):
    linkage, motion = swung(name)
    mechanism = PinocchioMechanism(FOLDER / name)
    assert [motor.name for motor in linkage.motors] == mechanism.motors
    assert len(linkage.idle_rotations) == idle
    torque, _ = linkage.torques(motion.time, motion.position, motion.velocity, motion.acceleration)
    columns = [joint.v for joint in linkage.motors]
    assert np.abs(motion.acceleration[:, columns]).max() > 1.0
    assert (np.ptp(motion.position[:, [joint.q for joint in linkage.motors]], axis=0) > 0.02).sum() >= driven
    largest, worst = np.abs(torque).max(), 0.0
    for k in range(len(motion.time)):
        q = mechanism.position(motion.joints, motion.position[k])
        v = mechanism.velocity(motion.joints, motion.velocity[k])
        assert mechanism.gap(q) < 1e-10
        assert np.abs(mechanism.jacobian(q) @ v).max() < 1e-10 * max(1.0, np.abs(v).max())
        wanted, a, free, residual = mechanism.solution(q, v, motion.acceleration[k, columns])
        assert free.shape[1] == idle
        assert np.abs(residual).max() < 1e-9 * largest
        found = mechanism.velocity(motion.joints, motion.acceleration[k])
        # of the idle rotations, forces are compared: some have an inertia of 3e-11 kg m², and rounding moves them
        more = found - a
        assert np.abs(more - free @ (free.T @ more)).max() < 1e-9 * max(1.0, np.abs(a).max())
        assert np.abs(pin.rnea(mechanism.model, mechanism.data, q, v, found) @ free).max(initial=0.0) < 1e-9 * largest
        worst = max(worst, np.abs(torque[k] - wanted).max())
    assert worst < 1e-9 * largest


@pytest.mark.tier2
def test_the_motions_of_idle_rotations_need_no_power():
    """Without gravity and friction, the power of the motors is the rate of kinetic energy, idle rotations included."""
    linkage, motion = swung("cassie_like")
    torque, _ = linkage.torques(motion.time, motion.position, motion.velocity, motion.acceleration)
    power = (torque * motion.velocity[:, [joint.v for joint in linkage.motors]]).sum(axis=1)
    robot = linkage.robot
    need = robot.inverse_dynamics(motion.position, motion.velocity, motion.acceleration)
    rate = (need * motion.velocity).sum(axis=1)  # of T + V
    assert np.abs(power - rate).max() < 1e-9 * np.abs(power).max()
