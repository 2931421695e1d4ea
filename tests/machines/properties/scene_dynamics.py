"""Inverse dynamics, mobility and derivatives of a scene with every kind of force, against KKT equations in NumPy.

The mass matrix and forces are Pinocchio's, the constraints those of the textbook (tests/support/plain_dynamics.py).
"""

import numpy as np
import pytest
from plain_loads import PlainLoads
from properties.dynamics import close
from properties.simulation import DIGITS

import bellcrank as bc


class SceneEquations:
    """Of every machine, at a state of a run."""

    def test_accelerations_and_multipliers_solve_the_kkt_system(self, loaded, loaded_run, plain_scene):
        for k in (17, -1):
            t, q, v = loaded_run.time[k], loaded_run.position[k], loaded_run.velocity[k]
            found = bc.scene_derivatives(loaded, q, v, t)
            acceleration, multipliers = plain_scene.at(t, q, v).accelerations()
            close(found.acceleration, acceleration, DIGITS)
            kept = rows_that_count(plain_scene)
            assert len(found.multiplier_names) == len(found.multipliers) == len(kept)
            if len(kept):
                close(found.multipliers, multipliers[kept], DIGITS)

    def test_additional_torques_act_as_in_the_kkt_system(self, loaded, loaded_run, plain_scene):
        t, q, v = (x[9] for x in (loaded_run.time, loaded_run.position, loaded_run.velocity))
        torque = np.linspace(0.7, -1.9, loaded.robot.nv)
        found, rest = bc.scene_derivatives(loaded, q, v, t, torque), bc.scene_derivatives(loaded, q, v, t)
        plain_scene.at(t, q, v)
        mass, jacobian = plain_scene.mass_matrix(), constraint_rows(plain_scene)[rows_that_count(plain_scene)]
        n, m = len(mass), len(jacobian)
        whole = np.linalg.inv(np.block([[mass, -jacobian.T], [jacobian, np.zeros((m, m))]]))
        close(rest.of_acceleration.torque, whole[:n, :n], DIGITS)
        close(found.acceleration - rest.acceleration, whole[:n, :n] @ torque, DIGITS)
        if m:
            close(rest.of_multipliers.torque, whole[n:, :n], DIGITS)
            close(found.multipliers - rest.multipliers, whole[n:, :n] @ torque, DIGITS)

    def test_mobility_is_the_null_space_of_the_constraints(self, loaded, loaded_run, plain_scene):
        found = bc.mobility(loaded)
        plain_scene.at(0.0, loaded_run.position[0], loaded_run.velocity[0])
        jacobian, nv = constraint_rows(plain_scene), loaded.robot.nv
        rank = np.linalg.matrix_rank(jacobian, tol=1e-6) if len(jacobian) else 0
        assert (found.freedoms, found.joint_freedoms, found.rank) == (nv - rank, nv, rank)
        assert found.conditions == len(rows_that_count(plain_scene)) and found.redundant == ()
        assert found.nearby_freedoms == found.freedoms
        columns = [loaded.robot.joint(name).v for name in found.motors]
        held = np.vstack([jacobian, np.eye(nv)[columns]])
        passive = np.linalg.svd(held)[2][np.linalg.matrix_rank(held, tol=1e-6) :] if held.size else np.eye(nv)
        assert found.passive_freedoms == len(passive)
        moving = [j.name for j in loaded.robot.joints if np.abs(passive[:, j.v : j.v + j.nv]).max(initial=0) > 1e-6]
        assert list(found.passive_joints) == moving
        assert len(found.independent_motors) == nv - rank - len(passive)
        assert set(found.independent_motors) | set(found.dependent_motors) == set(found.motors)


class DrivenScene:
    """Of machines whose joints or motors follow a motion."""

    def test_motors_and_multipliers_give_the_forces_that_the_motion_takes(self, driven, plain_scene):
        """S τ + Jᵀ λ = Q, less what acts at a free base, where no motor does."""
        columns, base = [driven.mechanism.robot.joint(name).v for name in driven.actuated], 0.0
        for k in rows_of_time(driven):
            needed, jacobian, _ = needs(plain_scene, driven, k)
            own = np.zeros_like(needed)
            own[columns] = driven.torque[k]
            own += jacobian[rows_that_count(plain_scene)].T @ driven.multipliers[k]
            free = slice(0, 6) if driven.mechanism.robot.floating_base else slice(0, 0)
            base = max(base, np.abs(needed[free]).max(initial=0.0) / np.abs(needed).max())
            own[free] = needed[free]
            close(own, needed, DIGITS)
        assert driven.equation_residual() >= base * (1.0 - DIGITS)
        if not base:
            assert driven.equation_residual() < 1e-10
        assert driven.redundancy == 0
        assert np.array_equal(driven.motor(driven.actuated[-1]), driven.torque[:, -1])

    def test_motion_keeps_the_constraints(self, driven, plain_scene):
        """φ = 0, J v = 0 and J a = −γ."""
        for k in rows_of_time(driven):
            needs(plain_scene, driven, k)
            v, a = driven.velocity[k], driven.acceleration[k]
            for entry in plain_scene.scene_data.get("constraints", ()):
                rows, gamma = plain_scene.constraint(entry)
                assert np.abs(gap(plain_scene, entry)).max() < 1e-12
                assert np.abs(rows @ v).max() < 1e-11 * max(1.0, np.abs(v).max())
                assert np.abs(rows @ a + gamma).max() < 1e-9 * max(1.0, np.abs(a).max())
        assert driven.constraint_residual() < 1e-12

    def test_power_of_the_motors_is_the_rate_of_energy_and_what_is_lost(self, driven, plain_scene):
        """d(T + V)/dt = τ·v plus the power of forces without potential; a free base is pushed too."""
        columns = [driven.mechanism.robot.joint(name).v for name in driven.actuated]
        for k in rows_of_time(driven):
            t, q, v, a = (x[k] for x in (driven.time, driven.position, driven.velocity, driven.acceleration))

            def energy(h, t=t, q=q, v=v, a=a):
                there = plain_scene.tree.displaced(q, h * v + 0.5 * h * h * a)
                return sum(plain_scene.at(t, there, v + h * a).energies())

            rate = (8.0 * (energy(1e-4) - energy(-1e-4)) - (energy(2e-4) - energy(-2e-4))) / 12e-4
            needed = needs(plain_scene, driven, k)[0]
            others = plain_scene.power() - sum(
                plain_scene.control(e) @ v for e in plain_scene.scene_data.get("control", ())
            )
            base = needed[:6] @ v[:6] if driven.mechanism.robot.floating_base else 0.0
            assert driven.power[k] == pytest.approx(driven.torque[k] @ v[columns], rel=1e-13)
            size = max(abs(rate), np.abs(needed).max() * np.abs(v).max())
            assert abs(driven.power[k] + base + others - rate) < 1e-7 * size

    def test_applied_forces_are_those_of_the_formulas(self, driven, plain_scene):
        for k in rows_of_time(driven):
            acting = needs(plain_scene, driven, k)[2]
            assert np.abs(acting).max() > 0.0
            close(driven.applied[k], acting, DIGITS)

    def test_reactions_are_the_wrenches_of_pinocchio_with_the_forces_on_links(self, loaded, driven, plain_scene):
        loads = PlainLoads(loaded, driven.actuated)
        loads.plain.tables = plain_scene.tables
        for k in rows_of_time(driven):
            state = [x[k] for x in (driven.position, driven.velocity, driven.acceleration)]
            loads.plain.at(driven.time[k], *state[:2])
            multipliers = np.zeros(len(constraint_rows(loads.plain)))
            multipliers[rows_that_count(loads.plain)] = driven.multipliers[k]
            wrenches = loads._wrenches(*state, multipliers)
            expected = np.array([wrenches[name] for name in loaded.robot.all_joint_names])
            for part in (slice(0, 3), slice(3, 6)):
                close(driven.reactions[k][:, part], expected[:, part], DIGITS)


# ---- the equations in NumPy


def rows_of_time(driven):
    """Rows of the motion to look at, not where it rests."""
    count = len(driven.time)
    return (count // 7, 2 * count // 5, 3 * count // 4)


def constraint_rows(plain):
    """J (rows, nv) of all constraints, at the state that is set."""
    return np.vstack(
        [np.zeros((0, plain.nv)), *(plain.constraint(e)[0] for e in plain.scene_data.get("constraints", ()))]
    )


def rows_that_count(plain):
    """The numbers of the rows of J that are not zero, such as that of z in a plane."""
    return np.flatnonzero(np.abs(constraint_rows(plain)).max(axis=1, initial=0.0) > 1e-9)


def gap(plain, entry):
    """By how much a loop is open, m."""
    a, b = plain.frame(entry["frame_a"]).position, plain.frame(entry["frame_b"]).position
    return a - b if entry["kind"] == "point" else np.array([np.linalg.norm(a - b) - entry["length"]])


def needs(plain, driven, k):
    """What motors and constraints give, J, and what other forces give, at row k of a motion; the state is set."""
    t, q, v, a = (x[k] for x in (driven.time, driven.position, driven.velocity, driven.acceleration))
    plain.at(t, q, v)
    acting = sum((plain.force(entry)[0] for entry in plain.scene_data["forces"]), np.zeros(plain.nv))
    needed = plain.tree.inverse_dynamics(q, v, a) - plain.friction() - acting
    return needed, constraint_rows(plain), acting
