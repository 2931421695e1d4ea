"""Closed-chain inverse dynamics of parallel robots that others built, against a KKT solution of plain Pinocchio.

From the same files, with nothing of bellcrank but the motors' motion and the posture, which is checked: J holds the
rows of both frames of each loop, v and a solve J v = 0 and J a = −J̇ v with the motors' rates, and S τ + Jᵀ λ = M a + h
gives τ and λ (Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 8). All are least-squares solutions, as J has
redundant rows. The joints' order and the equations' frames differ from bellcrank's.

Where a weld of two hinges with one axis leaves the piece between them free to turn about it, a hinge without a motor
holds it: it counts as a motor, in both computations.
"""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml

import bellcrank as bc

FOLDER = Path(__file__).parent / "parallel_robots"  # BSD-3-Clause, see the LICENSE there
AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class PinocchioMechanism:
    """The robot of a folder: its tree as Pinocchio reads it, its loops and motors as its YAML lists them."""

    def __init__(self, folder):
        self.model = pin.buildModelFromUrdf(str(folder / "robot.urdf"))
        self.data = self.model.createData()
        contents = yaml.safe_load((folder / "robot.yaml").read_text())
        self.motors = contents["name_mot"]
        self.held: list[str] = []
        self.loops = [
            (self.model.getFrameId(a), self.model.getFrameId(b), 3 if kind.lower() == "3d" else 6)
            for (a, b), kind in zip(contents["closed_loop"], contents["type"], strict=True)
        ]

    def hold_idle_joints(self, q):
        """Joints `held` beside the motors, the first that make the motion of all joints follow from theirs."""
        jacobian = self.jacobian(q)
        for name in self.model.names[1:]:
            if self._determined(jacobian, [*self.drives, name]) > self._determined(jacobian, self.drives):
                self.held.append(name)
        assert self._determined(jacobian, self.drives) == self.model.nv

    @property
    def drives(self):
        """The motors, then the joints that are held."""
        return [*self.motors, *self.held]

    def _determined(self, jacobian, names):
        """The rank of J with the rows of these joints."""
        return np.linalg.matrix_rank(np.concatenate([jacobian, self.selection(names).T]), tol=1e-7)

    def selection(self, names):
        """S, a column for each joint named."""
        found = np.zeros((self.model.nv, len(names)))
        for k, name in enumerate(names):
            found[self.model.joints[self.model.getJointId(name)].idx_v, k] = 1.0
        return found

    def coordinates(self, joints, values):
        """Values of bellcrank's joints in Pinocchio's order; all joints of these robots have one coordinate."""
        found = np.empty(self.model.nq)
        for joint in joints:
            found[self.model.joints[self.model.getJointId(joint.name)].idx_q] = values[joint.q]
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

    def torques(self, q, motor_speed, motor_acceleration):
        """(τ, v, a, residual of the equations of motion) at a closed posture."""
        jacobian, selection = self.jacobian(q), self.selection(self.drives)
        whole = np.concatenate([jacobian, selection.T])
        v = solve(whole, np.concatenate([np.zeros(len(jacobian)), motor_speed]))
        a = solve(whole, np.concatenate([-self.drift(q, v), motor_acceleration]))
        need = pin.crba(self.model, self.data, q) @ a + pin.nonLinearEffects(self.model, self.data, q, v)
        forces = np.concatenate([selection, jacobian.T], axis=1)
        found = solve(forces, need)
        return found[: len(self.drives)], v, a, need - forces @ found


def solve(matrix, right):
    """The least-squares solution of least norm, rank by singular values."""
    return np.linalg.lstsq(matrix, right, rcond=1e-11)[0]


def swung(name):
    """(linkage, mechanism, motion): the motors of a robot swing by up to 0.25 rad about the posture where it starts."""
    scene, mechanism = bc.load_scene(FOLDER / name / "robot.urdf"), PinocchioMechanism(FOLDER / name)
    linkage = bc.Linkage(scene)
    assert [motor.name for motor in linkage.motors] == mechanism.motors
    start = linkage.kinematics.start
    mechanism.hold_idle_joints(mechanism.coordinates(scene.robot.joints, start))
    linkage = bc.Linkage(scene, actuated=mechanism.drives)
    begin = {joint.name: float(start[joint.q]) for joint in linkage.motors}
    swings = np.random.default_rng(7).uniform(-0.25, 0.25, (3, len(begin)))
    swings[:, len(mechanism.motors) :] = 0.0
    there = [{joint: at + float(d) for (joint, at), d in zip(begin.items(), row, strict=True)} for row in swings]
    motion = bc.waypoints(scene.robot, times=[0, 0.3, 0.7, 1.0], positions=[begin, *there], samples=41)
    return linkage, mechanism, linkage.along(motion, mechanism.drives)[0]


@pytest.mark.parametrize(
    ("name", "idle"), [("5bar_linkage", 1), ("5bar_linkage_iso3d", 0), ("robot_delta", 3), ("cassie_like", 2)]
)
def test_motor_torques_are_those_of_pinocchio_s_kkt_equations(name, idle):
    linkage, mechanism, motion = swung(name)
    assert len(mechanism.held) == idle
    torque, _ = linkage.torques(motion.time, motion.position, motion.velocity, motion.acceleration)
    columns = [joint.v for joint in linkage.motors]
    moved = columns[: len(mechanism.motors)]
    assert np.ptp(motion.position[:, moved], axis=0).min() > 0.05 and np.abs(motion.acceleration[:, moved]).max() > 1.0
    largest = np.abs(torque[:, : len(moved)]).max()
    for k in range(len(motion.time)):
        q = mechanism.coordinates(motion.joints, motion.position[k])
        assert mechanism.gap(q) < 1e-10
        wanted, v, a, residual = mechanism.torques(q, motion.velocity[k, columns], motion.acceleration[k, columns])
        assert np.abs(residual).max() < 1e-9 * largest
        speed = mechanism.coordinates(motion.joints, motion.velocity[k])
        growth = mechanism.coordinates(motion.joints, motion.acceleration[k])
        np.testing.assert_allclose(speed, v, rtol=0, atol=1e-9 * max(1.0, np.abs(v).max()))
        np.testing.assert_allclose(growth, a, rtol=0, atol=1e-9 * max(1.0, np.abs(a).max()))
        np.testing.assert_allclose(torque[k], wanted, rtol=0, atol=1e-9 * largest)
