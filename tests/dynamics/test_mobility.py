"""Starts and mobility of 100 random mechanisms, and of mechanisms whose mobility is known."""

import numpy as np
import pinocchio as pin
import pytest

import bellcrank as bc
from bellcrank.dynamics.constraints.constraint_rows import velocity_units
from bellcrank.dynamics.postures.consistent_start import consistent_start
from tests.support.random_mechanisms import random_mechanism

pytestmark = pytest.mark.tier2

STEP = 1e-6  # rad or m: of central differences
CLOSED = 1e-10  # m or rad


class Gaps:
    """The residuals of a random mechanism's constraints from Pinocchio's placements of its frames alone."""

    def __init__(self, scene, path):
        self.scene, self.model = scene, pin.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self.entries = scene.data["constraints"]

    def place(self, name):
        frame = self.scene.data["frames"][name]
        local = pin.SE3(pin.rpy.rpyToMatrix(np.array(frame["rpy"])), np.array(frame["xyz"]))
        return self.data.oMf[self.model.getFrameId(frame["link"])] * local

    def __call__(self, q):
        full = pin.neutral(self.model)
        for joint in self.scene.robot.joints:
            own = self.model.joints[self.model.getJointId(joint.name)]
            angle = q[joint.q]
            full[own.idx_q : own.idx_q + own.nq] = [angle] if own.nq == 1 else [np.cos(angle), np.sin(angle)]
        pin.framesForwardKinematics(self.model, self.data, full)
        return np.concatenate([self.of(entry, q) for entry in self.entries])

    def of(self, entry, q):
        if entry["kind"] == "coupling":
            a, b = (q[self.scene.robot.joint(entry[side]).q] for side in ("joint_a", "joint_b"))
            return np.array([b - entry["ratio"] * a - entry["offset"]])
        a, b = self.place(entry["frame_a"]), self.place(entry["frame_b"])
        apart = a.translation - b.translation
        if entry["kind"] == "distance":
            return np.array([np.linalg.norm(apart) - entry["length"]])
        if entry["kind"] == "point":
            return apart
        if entry["kind"] == "hinge":  # the axes of both coincide, and do not oppose each other
            return np.concatenate([apart, a.rotation[:, 2] - b.rotation[:, 2]])
        return np.concatenate([apart, pin.log3(b.rotation.T @ a.rotation)])

    def jacobian(self, q):
        """By central differences, in rad and characteristic lengths."""
        units = velocity_units(self.scene)
        moves = np.diag(STEP * units)
        return np.array([(self(q + move) - self(q - move)) / (2 * STEP) for move in moves]).T


@pytest.mark.parametrize("seed", range(100))
def test_a_random_mechanism_finds_its_start_and_its_mobility_is_the_rank_of_its_jacobian(seed, tmp_path):
    mechanism = random_mechanism(seed, tmp_path)
    scene, gaps = mechanism.scene, Gaps(mechanism.scene, tmp_path / f"random_{seed}.urdf")
    assert np.abs(gaps(mechanism.posture)).max() < 1e-12  # so that there is a start
    q = consistent_start(scene)[0]
    assert np.abs(gaps(q)).max() < CLOSED
    singular = np.linalg.svd(gaps.jacobian(q), compute_uv=False)
    largest, found = singular[0], bc.mobility(scene)
    # differences are accurate to 1e-9; between 1e-7 and 1e-6 it is not clear what is 0, and there is none
    assert not ((singular > 1e-7 * largest) & (singular < 1e-6 * largest)).any()
    rank = int(np.count_nonzero(singular > 1e-6 * largest))
    assert (found.rank, found.freedoms) == (rank, scene.robot.nv - rank)
    assert found.joint_freedoms == scene.robot.nv
    assert sum(count for _, count in found.redundant) == found.conditions - rank
