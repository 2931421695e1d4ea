"""Dynamics of a machine's tree, against plain Pinocchio, against each other and against Newton's and Euler's laws.

The robot is `laden` with rotors, friction, payloads and gravity askew, so that every term counts.
"""

import numpy as np
import pinocchio
import pytest
from extrapolated import slope
from machine import laden_options
from scaled_robot import scaled_options, scaled_urdf, units

import bellcrank as bc


def close(found, expected, bound=1e-12):
    """Whether two arrays agree to a bound relative to the largest entry."""
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    assert np.abs(found - expected).max(initial=0.0) <= bound * np.abs(expected).max(initial=1e-300)


class Dynamics:
    def test_exact_rotations_in_place_of_rounded_ones_change_nothing_that_matters(self, robot, plain, states):
        """Rotations such as 1.5708 are made exact as they are read, by at most 1e-11."""
        own = robot.inverse_dynamics(*states) - robot.friction_torque(states[1])
        close(own, [plain.inverse_dynamics(*state) for state in zip(*states, strict=True)], 1e-10)

    def test_inverse_dynamics_without_friction_is_that_of_pinocchio(self, laden, plain_laden, states):
        own = laden.inverse_dynamics(*states) - laden.friction_torque(states[1])
        close(own, [plain_laden.inverse_dynamics(*state) for state in zip(*states, strict=True)])

    def test_friction_is_viscous_and_smoothed_coulomb_friction(self, laden, robot, states):
        options, v = laden_options(robot), states[1]
        expected, width = np.zeros_like(v), options["friction_width"]
        for name, (viscous, coulomb) in options["friction"].items():
            k = laden.joint(name).v
            expected[:, k] = viscous * v[:, k] + coulomb * v[:, k] / np.sqrt(v[:, k] ** 2 + width**2)
            assert (laden.viscous[k], laden.coulomb[k]) == (viscous, coulomb)
        assert laden.friction_torque(v) == pytest.approx(expected, rel=1e-13, abs=1e-15)

    def test_forward_dynamics_satisfies_the_equations_with_pinocchios_mass_matrix(self, laden, plain_laden, states):
        q, v, torque = states
        found, net = laden.forward_dynamics(q, v, torque), torque - laden.friction_torque(v)
        for k in range(len(q)):
            bias = plain_laden.inverse_dynamics(q[k], v[k], 0.0 * v[k])
            inertial = plain_laden.mass_matrix(q[k]) @ found[k]
            size = max(np.abs(bias).max(), np.abs(inertial).max())
            assert np.abs(inertial + bias - net[k]).max() <= 1e-11 * size

    def test_forward_dynamics_undoes_inverse_dynamics(self, laden, states):
        q, v, a = states
        close(laden.forward_dynamics(q, v, laden.inverse_dynamics(q, v, a)), a, 1e-10)

    def test_mass_matrix_is_that_of_pinocchio_and_the_derivative_of_torque(self, laden, plain_laden, states):
        q, v, a = states
        mass = laden.mass_matrix(q)
        close(mass, [plain_laden.mass_matrix(row) for row in q])
        close(laden.inverse_dynamics(q, v, a) - laden.inverse_dynamics(q, v, 0.0 * a), np.einsum("nij,nj->ni", mass, a))
        columns = [laden.joint(name).v for name in laden.joint_names]
        assert np.array_equal(laden.inertia_diagonal(q), np.diagonal(mass, axis1=1, axis2=2)[:, columns])
        assert np.linalg.eigvalsh(mass).min() > 0.0

    def test_gravity_torque_is_that_of_pinocchio_and_of_rest(self, laden, plain_laden, states):
        q, rest = states[0], np.zeros_like(states[1])
        close(laden.gravity_torque(q), [plain_laden.gravity_torque(row) for row in q])
        close(laden.gravity_torque(q), laden.inverse_dynamics(q, rest, rest), 1e-13)

    def test_energies_are_those_of_pinocchio(self, laden, plain_laden, states):
        q, v, _ = states
        expected = np.array([plain_laden.energy(*state) for state in zip(q, v, strict=True)]).T
        for found, energy in zip(laden.energy(q, v), expected, strict=True):
            close(found, energy)

    def test_power_of_the_torques_is_the_rate_of_energy_and_what_friction_takes(self, laden, plain_laden, states):
        """d(T + V)/dt = (τ − friction) · v along an accelerated motion, by extrapolated differences."""
        for q, v, a in zip(*(x[:4] for x in states), strict=True):
            power = (laden.inverse_dynamics(q, v, a) - laden.friction_torque(v)) @ v

            def energy(h, q=q, v=v, a=a):
                there = plain_laden.displaced(q, h * v + 0.5 * h * h * a)  # to second order: no more is needed
                return np.array(laden.energy(there, v + h * a))

            rate = slope(energy)
            assert rate.sum() == pytest.approx(power, rel=1e-9, abs=1e-9 * np.abs(rate).max())

    def test_share_of_each_link_is_that_of_its_newton_and_euler_equations(self, laden, plain_laden, states):
        """Jᵀ of m (v̇ − g) at the centre of mass and of I ω̇ + ω × I ω, by the kinematics of Pinocchio."""
        q, v, a = (x[:2] for x in states)
        shares, still = laden.link_torques(q, v, a), laden.link_gravity_torques(q)
        bodies, unit = plain_laden.bodies(), np.eye(laden.nv)
        assert set(laden.massive_links) <= set(bodies)
        for at, name in enumerate(laden.massive_links):
            frame, mass, centre, inertia = bodies[name]
            for k in range(len(q)):
                here = plain_laden.frame(frame, q[k], v[k], a[k])
                columns = [plain_laden.frame(frame, q[k], each) for each in unit]
                spins = np.array([column["spin"] for column in columns])
                arm, turned = here["rotation"] @ centre, here["rotation"] @ inertia @ here["rotation"].T
                moves = np.array([column["velocity"] for column in columns]) + np.cross(spins, arm)
                spin, spin_up = here["spin"], here["spin_up"]
                growth = here["acceleration"] + np.cross(spin_up, arm) + np.cross(spin, np.cross(spin, arm))
                moment = turned @ spin_up + np.cross(spin, turned @ spin)
                weight = moves @ (-mass * np.array(plain_laden.gravity))
                share = moves @ (mass * growth) + spins @ moment + weight
                bound = 1e-11 * np.abs(shares[k]).max()
                assert np.abs(shares[k, at] - share).max() <= bound
                assert np.abs(still[k, at] - weight).max() <= bound
        rest = plain_laden.rotors * a + laden.friction_torque(v)
        close(shares.sum(axis=1) + rest, laden.inverse_dynamics(q, v, a))

    def test_joint_reactions_are_the_wrenches_of_pinocchio_and_do_the_joints_work(self, laden, plain_laden, states):
        wrenches, torque = laden.joint_reactions(*states), laden.inverse_dynamics(*states)
        rows = [plain_laden.reactions(*state) for state in zip(*states, strict=True)]
        close(wrenches, [[row[name] for name in laden.all_joint_names] for row in rows])
        torque -= laden.friction_torque(states[1]) + plain_laden.rotors * states[2]
        mimics = {name for mimic in laden.mimics() for name in (mimic.leader, mimic.follower)}
        for joint in laden.joints:
            own = wrenches[:, laden.all_joint_names.index(joint.name)]
            if joint.kind == "floating":
                close(own, torque[:, joint.v : joint.v + 6])
            elif joint.name not in mimics:
                part = slice(0, 3) if joint.kind == "prismatic" else slice(3, 6)
                assert own[:, part] @ laden.joint_axis(joint.name) == pytest.approx(torque[:, joint.v], abs=1e-9)

    def test_frames_move_as_those_of_pinocchio(self, laden, plain_laden, states):
        for name in ("gripper", laden.massive_links[0]):
            rows = [plain_laden.frame(name, *state) for state in zip(*states, strict=True)]
            found = [
                *laden.frame_pose(name, states[0]), *laden.frame_velocity(name, *states[:2]),
                *laden.frame_acceleration(name, *states),
            ]  # fmt: skip
            for own, key in zip(found, rows[0], strict=True):
                close(own, [row[key] for row in rows])

    def test_rate_of_the_position_is_that_of_moving_on(self, laden, plain_laden, states):
        for q, v, _ in zip(*(x[:4] for x in states), strict=True):
            rate = slope(lambda h, q=q, v=v: plain_laden.displaced(q, h * v))
            assert laden.configuration_rate(q, v) == pytest.approx(rate, rel=1e-10, abs=1e-11)

    def test_a_batch_is_its_samples(self, laden, states):
        """Bits do not depend on how many samples there are; one sample by itself may differ in the last one."""
        q, v, a = states
        for function, inputs in (
            (laden.inverse_dynamics, (q, v, a)), (laden.forward_dynamics, (q, v, a)), (laden.mass_matrix, (q,)),
            (laden.gravity_torque, (q,)), (laden.link_torques, (q, v, a)), (laden.joint_reactions, (q, v, a)),
        ):  # fmt: skip
            whole = function(*inputs)
            for rows in (slice(0, 1), slice(3, 8), slice(7, 20)):
                assert np.array_equal(function(*[x[rows] for x in inputs]), whole[rows])
            for k in (0, 13):
                close(function(*[x[k] for x in inputs]), whole[k], 1e-12)
            held = [x if x is inputs[-1] else np.tile(x[5], (20, 1)) for x in inputs]
            assert np.array_equal(function(*[x[5] for x in inputs[:-1]], inputs[-1]), function(*held))

    def test_lengths_in_micrometres_change_the_units_only(self, machine, robot, laden, states, tmp_path):
        """Friction is left out, as its width is in rad/s and m/s alike.

        The accelerations of free bodies are compared in millimetres: their 6 × 6 inertia is inverted without scaling,
        so that in micrometres accelerations have 6 digits.
        """
        free = any(joint.kind == "floating" for joint in robot.joints)
        options, urdf = laden_options(robot), tmp_path / "small.urdf"

        def scaled(factor):
            scaled_urdf(robot.source, urdf, factor)
            own = scaled_options(robot, options, factor)
            return bc.load_robot(urdf, floating_base=machine.floating_base, **own), *units(robot, factor)

        (q, v, a), friction = states, laden.friction_torque(states[1])
        small, q_unit, v_unit, unit = scaled(1e6)
        torque = small.inverse_dynamics(q * q_unit, v * v_unit, a * v_unit) / unit
        close(torque, laden.inverse_dynamics(q, v, a) - friction)
        if free:
            small, q_unit, v_unit, unit = scaled(1e3)
        found = small.forward_dynamics(q * q_unit, v * v_unit, a * unit) / v_unit
        close(found, laden.forward_dynamics(q, v, a + friction), 1e-10)


class FreeBaseDynamics:
    def test_wrench_at_the_base_is_the_rate_of_momentum_less_the_weight(self, laden, plain_laden, states):
        """Newton's and Euler's laws for the whole machine, about its centre of mass."""
        model, data = plain_laden.model, plain_laden.data
        for q, v, a in zip(*states, strict=True):
            there = plain_laden.position(q)
            rate = pinocchio.computeCentroidalMomentumTimeVariation(model, data, there, v, a)
            torque, (origin, axes) = laden.inverse_dynamics(q, v, a), laden.frame_pose("root_joint", q)
            force, moment = axes @ torque[:3], axes @ torque[3:6]
            weight = data.mass[0] * np.array(plain_laden.gravity)
            assert force + weight == pytest.approx(np.array(rate.linear), rel=1e-10, abs=1e-9)
            about = moment + np.cross(origin - data.com[0], force)
            assert about == pytest.approx(np.array(rate.angular), rel=1e-10, abs=1e-9)

    def test_free_fall_is_that_of_the_centre_of_mass(self, laden, plain_laden, states):
        """Without torques at the joints the centre of mass has the acceleration of gravity."""
        model, data = plain_laden.model, plain_laden.data
        for q, v, _ in zip(*states, strict=True):
            a = laden.forward_dynamics(q, v, np.zeros_like(v))
            pinocchio.centerOfMass(model, data, plain_laden.position(q), v, a)
            assert np.array(data.acom[0]) == pytest.approx(np.array(plain_laden.gravity), rel=1e-9)
