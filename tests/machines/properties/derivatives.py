"""Derivatives of dynamics, against extrapolated differences of equations by plain Pinocchio, and identities."""

from copy import deepcopy
from types import SimpleNamespace

import altered
import casadi
import numpy as np
import pytest
from extrapolated import slope
from machine import laden_options
from plain_dynamics import PlainDynamics
from properties.dynamics import close
from properties.simulation import DIGITS

import bellcrank as bc

SAMPLES = 2
BETWEEN_KINKS = 17  # a row of the loaded run, whose torque table has kinks


class Derivatives:
    def test_derivatives_of_torques_are_differences_of_pinocchios(self, laden, plain_laden, states):
        """Of the position along q ⊕ h e_k; friction is added by its formula."""
        q, v, a = (x[:SAMPLES] for x in states)
        found, options = laden.inverse_dynamics_derivatives(q, v, a), laden_options(laden)
        for k in range(SAMPLES):
            by_q, by_v = [], friction_slopes(laden, options, v[k])
            for e in np.eye(laden.nv):
                moved = slope(
                    lambda h, e=e, k=k: plain_laden.inverse_dynamics(plain_laden.displaced(q[k], h * e), v[k], a[k])
                )
                by_q.append(moved)
                faster, slower = (plain_laden.inverse_dynamics(q[k], v[k] + s * e, a[k]) for s in (1.0, -1.0))
                by_v += np.outer(0.5 * (faster - slower), e)  # quadratic in v: exact
            close(found.by_position[k], np.array(by_q).T, 1e-10)
            close(found.by_velocity[k], by_v, 1e-11)
            close(found.mass_matrix[k], plain_laden.mass_matrix(q[k]))

    def test_derivatives_of_accelerations_are_those_of_torques_through_the_mass_matrix(
        self, laden, plain_laden, states
    ):
        """M ∂a/∂x = −∂τ/∂x at the acceleration, and M M⁻¹ = 1."""
        q, v, a = (x[:SAMPLES] for x in states)
        torque = [plain_laden.inverse_dynamics(*state) for state in zip(q, v, a, strict=True)]
        torque += laden.friction_torque(v)
        found, inverse = laden.forward_dynamics_derivatives(q, v, torque), laden.inverse_dynamics_derivatives(q, v, a)
        for k in range(SAMPLES):
            mass = plain_laden.mass_matrix(q[k])
            assert found.inverse_mass_matrix[k] @ mass == pytest.approx(np.eye(laden.nv), abs=1e-10)
            close(mass @ found.by_position[k], -inverse.by_position[k], 1e-9)
            close(mass @ found.by_velocity[k], -inverse.by_velocity[k], 1e-9)

    def test_derivatives_by_numbers_of_the_robot_are_differences_of_changed_models(self, laden, plain_laden, states):
        """Lengths, angles, masses, centres and inertias; torques are linear or quadratic in all but angles."""
        q, v, a = (x[0] for x in states)
        link = laden.massive_links[0]
        turning = [j.name for j in laden.joints if j.kind in ("revolute", "prismatic")][-1:]
        names = [f"joint.{name}.origin.{what}" for name in turning for what in (*altered.AXES, *altered.TURNS)]
        names += [f"link.{link}.{what}" for what in ("mass", "scale", *(f"cg.{x}" for x in altered.AXES))]
        names += [f"link.{link}.inertia.{what}" for what in altered.MOMENTS]
        found = laden.inverse_dynamics_parameter_derivatives(q, v, a, names)
        size = np.abs(laden.inverse_dynamics(q, v, a)).max()
        for k, name in enumerate(names):
            model = deepcopy(plain_laden)
            change = altered.number(model, name)

            def torque(h, change=change, model=model):
                change(h)
                return model.inverse_dynamics(q, v, a)

            angle = name.endswith(altered.TURNS)
            expected = slope(torque) if angle else 0.5 * (torque(1.0) - torque(-1.0))
            assert np.abs(found[:, k] - expected).max() <= 1e-10 * max(size, np.abs(expected).max()), name

    def test_derivatives_by_gravity_rotors_and_friction_are_their_factors(self, laden, plain_laden, states):
        q, v, a = (x[1] for x in states)
        joints = laden.joint_names[-2:]
        names = [f"gravity.{axis}" for axis in altered.AXES]
        names += [f"joint.{name}.{what}" for name in joints for what in ("rotor_inertia", "viscous", "coulomb")]
        found = laden.inverse_dynamics_parameter_derivatives(q, v, a, names)
        expected = np.zeros_like(found)
        for k, axis in enumerate(np.eye(3)):
            model = deepcopy(plain_laden)
            model.model.gravity.linear = axis
            expected[:, k] = model.gravity_torque(q)
        for k, name in enumerate(joints):
            place = laden.joint(name).v
            speed = v[place]
            factors = a[place], speed, speed / np.hypot(speed, laden_options(laden)["friction_width"])
            expected[place, 3 + 3 * k : 6 + 3 * k] = factors
        close(found, expected)

    def test_casadi_functions_are_the_methods_of_their_names(self, laden, states):
        q, v, a = (x[3] for x in states)
        torque = laden.inverse_dynamics(q, v, a)
        pose, speed = laden.frame_pose("gripper", q), laden.frame_velocity("gripper", q, v)
        for name, given, expected in (
            ("inverse_dynamics", (q, v, a), [torque]),
            ("forward_dynamics", (q, v, torque), [laden.forward_dynamics(q, v, torque)]),
            ("mass_matrix", (q,), [laden.mass_matrix(q)]),
            ("energy", (q, v), laden.energy(q, v)),
            ("configuration_rate", (q, v), [laden.configuration_rate(q, v)]),
            ("frame", (q, v), [*pose, *speed]),
        ):
            called(laden.casadi(name, frame="gripper" if name == "frame" else None), given, expected)

    def test_casadi_derivatives_are_the_methods_of_their_names(self, laden, states):
        for name in ("inverse_dynamics_derivatives", "forward_dynamics_derivatives"):
            given = [x[3] for x in states]
            called(laden.casadi(name), given, getattr(laden, name)(*given))


class JointDerivatives:
    """Of a tree with joints that turn or slide."""

    def test_casadi_differentiates_the_place_of_a_frame_by_a_length(self, laden, plain_laden, states):
        q, v, _ = (x[4] for x in states)
        kinds = {joint.name: joint.kind for joint in laden.joints}
        carried = [
            (frame, joint)
            for frame in ("gripper", laden.massive_links[0])
            for joint in laden.supporting_joints(frame)
            if kinds.get(joint) in ("revolute", "prismatic")
        ]
        frame, joint = carried[-1]
        name = f"joint.{joint}.origin.y"
        function = laden.casadi("frame", frame=frame, parameters=[name])
        p, model = casadi.SX.sym("p"), deepcopy(plain_laden)
        change = altered.number(model, name)

        def moved(h):
            change(h)
            return model.frame(frame, q)["position"]

        expected = 0.5 * (moved(1.0) - moved(-1.0))
        slope_of = casadi.Function("slope", [p], [casadi.jacobian(function(q, v, p)[0], p)])
        assert np.array(slope_of(0.3)).ravel() == pytest.approx(expected, abs=1e-12)
        assert np.linalg.norm(expected) == pytest.approx(1.0)


class SceneDerivatives:
    """Of the loaded scene, whose accelerations and multipliers are those of the KKT system in NumPy."""

    @pytest.fixture(scope="class")
    def scene_slopes(self, loaded, loaded_run):
        t, q, v = state_of(loaded_run)
        return bc.scene_derivatives(loaded, q, v, t)

    def test_derivatives_by_position_velocity_and_time(self, scene_slopes, loaded_run, plain_scene):
        t, q, v = state_of(loaded_run)
        kept, unit = rows_kept(plain_scene, t, q, v), np.eye(len(v))

        def at(t, q, v):
            acceleration, multipliers = plain_scene.at(t, q, v).accelerations()
            return np.hstack([acceleration, multipliers[kept]])

        by_q = [slope(lambda h, e=e: at(t, plain_scene.tree.displaced(q, h * e), v), 0.02) for e in unit]
        by_v = [slope(lambda h, e=e: at(t, q, v + h * e), 0.02) for e in unit]
        by_t = slope(lambda h: at(t + h, q, v), 1e-3)
        for what, expected in (("position", np.array(by_q).T), ("velocity", np.array(by_v).T), ("time", by_t)):
            compare(scene_slopes, what, expected, len(v))

    def test_derivatives_by_parameters(self, loaded, scene_slopes, loaded_run, plain_scene):
        t, q, v = state_of(loaded_run)
        kept = rows_kept(plain_scene, t, q, v)
        for k, parameter in enumerate(loaded.data["parameters"].values()):
            changed = PlainDynamics(SimpleNamespace(data=deepcopy(loaded.data), robot=loaded.robot), plain_scene.tables)
            change = change_of(changed, parameter)

            def at(h, change=change, changed=changed):
                change(h)
                acceleration, multipliers = changed.at(t, q, v).accelerations()
                return np.hstack([acceleration, multipliers[kept]])

            size = abs(parameter["value"])
            expected = slope(lambda h, size=size, at=at: at(h * size), 0.02) / size
            compare(scene_slopes, "parameters", expected, len(v), k)

    def test_casadi_function_of_a_scene_is_its_equations(self, loaded, loaded_run, plain_scene):
        t, q, v = state_of(loaded_run)
        function = bc.scene_casadi(loaded)
        signals = loaded.signals_at(np.array([t]))[0]
        rate, acceleration, multipliers = (
            np.array(x).ravel() for x in function(t, q, v, signals, loaded.own_parameters)
        )
        expected = plain_scene.at(t, q, v).accelerations()
        close(rate, plain_scene.position_rate())
        close(acceleration, expected[0], DIGITS)
        if len(multipliers):
            close(multipliers, expected[1][rows_kept(plain_scene, t, q, v)], DIGITS)


# ---- parts


def called(function, given, expected):
    """The casadi Function gives the expected arrays."""
    for own, value in zip(function.call([*given]), expected, strict=True):
        close(np.array(own).reshape(np.shape(value)), value, 1e-11)


def friction_slopes(robot, options, v):
    """∂(friction)/∂v: viscous + coulomb width² / √(v² + width²)³ at each joint."""
    found, width = np.zeros((robot.nv, robot.nv)), options["friction_width"]
    for name, (viscous, coulomb) in options["friction"].items():
        k = robot.joint(name).v
        found[k, k] = viscous + coulomb * width**2 / np.hypot(v[k], width) ** 3
    return found


def state_of(run):
    """A time between the kinks of the torque's table, and position and velocity then."""
    return run.time[BETWEEN_KINKS], run.position[BETWEEN_KINKS], run.velocity[BETWEEN_KINKS]


def rows_kept(plain, t, q, v):
    """The numbers of the constraints' rows that are not zero, such as that of z in a plane."""
    plain.at(t, q, v)
    rows = [plain.constraint(entry)[0] for entry in plain.scene_data.get("constraints", ())]
    return np.flatnonzero(np.abs(np.vstack([np.zeros((0, plain.nv)), *rows])).max(axis=1, initial=0.0) > 1e-9)


def compare(found, what, expected, nv, column=None):
    for part, rows in ((found.of_acceleration, slice(0, nv)), (found.of_multipliers, slice(nv, None))):
        own, reference = getattr(part, what), expected[rows]
        own = own if column is None else own[:, column]
        assert own.shape == reference.shape
        assert np.abs(own - reference).max(initial=0.0) <= DIGITS * max(np.abs(expected).max(), 1e-3), what


def change_of(plain, parameter):
    """What adds a number to the value of a scene's parameter."""
    changes = []
    for target in parameter.get("sets", ()):
        kind, name, key = target.split(".", 2)
        if kind == "forces":
            entry = next(each for each in plain.scene_data["forces"] if each["name"] == name)
            changes.append(lambda h, entry=entry, key=key: entry.update({key: parameter["value"] + h}))
        else:
            changes.append(altered.number(plain.tree, target))

    def change(h):
        for each in changes:
            each(h)

    return change
