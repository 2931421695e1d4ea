"""A robot with a free base: momentum, the path of its centre of mass, and a start in the world's or the body's axes."""

import numpy as np
import pinocchio as pin
import pytest

import bellcrank as bc

GRAVITY = np.array([0.3, -0.8, -9.7])
VELOCITY = {"linear_velocity": [0.5, -0.3, 0.9], "angular_velocity": [1.3, -0.8, 0.6]}


class FreeBase:
    @pytest.fixture(scope="class")
    def falling(self, machine):
        """A free fall with joints that move and lose energy: inner forces only."""
        start = {**machine.loads.start, "constraints": [], "gravity": GRAVITY.tolist()}
        start["base"] = {"position": [0.1, -0.2, 0.5], "rpy": [0.3, -0.4, 0.7], **VELOCITY}
        if machine.loads.joints:
            names = list(machine.loads.joints)
            start["forces"] = [
                {"name": "drag", "kind": "damper", "joint": names[0], "coefficient": 0.01},
                {"name": "coil", "kind": "joint_spring", "joint": names[1], "stiffness": 0.4, "rest": 0.3},
            ]
        start["outputs"] = {name: {"momentum": name} for name in ("linear", "angular")}
        scene = machine.load_scene(**start)
        return bc.simulate(scene, 0.6, "DOP853", 1e-11, 1e-12, samples=25)

    @staticmethod
    def momentum(run, plain):
        """Centre of mass (n, 3), and linear and angular momentum (n, 3) about the world's origin, by Pinocchio."""
        rows = []
        for q, v in zip(run.position, run.velocity, strict=True):
            own = plain.position(q)
            pin.computeCentroidalMomentum(plain.model, plain.data, own, plain.map @ v)
            centre, momentum = np.array(plain.data.com[0]), plain.data.hg
            linear = np.array(momentum.linear)
            rows.append([centre, linear, momentum.angular + np.cross(centre, linear)])
        return np.moveaxis(np.array(rows), 1, 0)

    def test_momenta_are_those_of_pinocchio(self, falling, plain):
        _, linear, angular = self.momentum(falling, plain)
        assert falling.output("linear") == pytest.approx(linear, abs=1e-8 * np.abs(linear).max())
        assert falling.output("angular") == pytest.approx(angular, abs=1e-8 * np.abs(angular).max())

    def test_the_centre_of_mass_follows_a_parabola(self, falling, plain):
        centre, linear, _ = self.momentum(falling, plain)
        mass, t = pin.computeTotalMass(plain.model), falling.time[:, None]
        expected = centre[0] + linear[0] / mass * t + 0.5 * GRAVITY * t**2
        assert np.abs(expected[-1] - expected[0]).min() > 0.01
        assert centre == pytest.approx(expected, abs=1e-9)

    def test_gravity_alone_changes_the_momenta(self, falling, plain):
        """Linear momentum by m g t; angular momentum about the moving centre of mass not at all."""
        centre, _, _ = self.momentum(falling, plain)
        linear, angular = falling.output("linear"), falling.output("angular")
        weight = pin.computeTotalMass(plain.model) * GRAVITY
        assert linear == pytest.approx(linear[0] + weight * falling.time[:, None], abs=1e-9 * np.abs(linear).max())
        spin = angular - np.cross(centre, linear)
        assert np.linalg.norm(spin[0]) > 1e-4
        assert spin == pytest.approx(np.tile(spin[0], (len(spin), 1)), abs=1e-9 * np.abs(spin).max())

    def test_what_the_joints_lose_is_the_work(self, machine, falling):
        total = falling.total_energy
        assert total - total[0] == pytest.approx(falling.work, abs=1e-9 * np.abs(total).max())
        assert (falling.work[-1] < -1e-4) == bool(machine.loads.joints)

    def test_a_start_in_the_worlds_axes_is_the_same_in_the_bodys(self, machine):
        position, rpy = [0.1, -0.2, 0.5], [0.3, -0.4, 0.7]
        turn = pin.rpy.rpyToMatrix(*rpy)
        x, y, z, w = pin.Quaternion(turn).coeffs()
        body = {name: (turn.T @ value).tolist() for name, value in VELOCITY.items()}
        world = {"position": position, "rpy": rpy, **VELOCITY, "expressed_in": "world"}
        own = {"position": position, "quaternion_xyzw": [x, y, z, w], **body, "expressed_in": "body"}
        free = {"constraints": [], "outputs": {}, "initial": {}}
        starts = [bc.simulate(machine.load_scene(**free, base=base), 0.01, samples=2) for base in (world, own)]
        for run in starts:
            assert run.position[0, :3] == pytest.approx(position, abs=1e-15)
            assert run.position[0, 3:7] == pytest.approx([x, y, z, w], abs=1e-14)
            assert run.velocity[0, :3] == pytest.approx(body["linear_velocity"], abs=1e-14)
            assert run.velocity[0, 3:6] == pytest.approx(body["angular_velocity"], abs=1e-14)
        assert starts[0].state == pytest.approx(starts[1].state, abs=1e-12)
