"""Linear equations, modes and Floquet multipliers, against reductions in NumPy of equations by plain Pinocchio."""

import csv
import json

import numpy as np
import pytest
from extrapolated import slope
from plain_dynamics import PlainDynamics
from properties.derivatives import BETWEEN_KINKS, rows_kept, state_of
from properties.dynamics import close
from properties.simulation import DIGITS
from scipy.io import loadmat
from scipy.linalg import null_space
from scipy.optimize import linear_sum_assignment

import bellcrank as bc

PERIOD = 4e-3  # s: short beside the fastest decay of the arms that are held


class LinearEquations:
    """A, B, C and D at a moment of the loaded scene's run, where every force acts."""

    @pytest.fixture(scope="class")
    def linear(self, loaded_run):
        return bc.linearise(loaded_run, at=float(loaded_run.time[BETWEEN_KINKS]))

    def test_field_is_that_of_small_displacements_of_plain_equations(self, linear, loaded_run, plain_scene, reduced):
        assert linear.kind == "not steady" and linear.stable is None and linear.modes == ()
        t, q, v = state_of(loaded_run)
        assert np.array_equal(linear.position, q) and np.array_equal(linear.velocity, v) and linear.time == t
        close(linear.A, reduced.field, DIGITS)
        values = np.linalg.eigvals(reduced.field)
        matched(linear.frozen_eigenvalues, values, 1e-5 * np.abs(values).max())
        with pytest.raises(bc.InputError, match="neither an equilibrium nor a steady motion"):
            linear.eigenvalues.any()

    def test_inputs_are_joint_torques_that_act_through_the_kkt_system(self, linear, reduced):
        expected = np.vstack([np.zeros((len(reduced.positions), len(linear.inputs))), reduced.by_torque])
        assert linear.B.shape == expected.shape
        if linear.inputs:
            close(linear.B, expected, DIGITS)

    def test_outputs_change_as_differences_of_their_formulas(self, linear, loaded_run, plain_scene, reduced):
        t, q, v = state_of(loaded_run)
        titles = [title for title, _ in linear.outputs]

        def values(step):
            nv = len(v)
            return formulas(plain_scene.at(t, plain_scene.tree.displaced(q, step[:nv]), v + step[nv:]))

        found = list(values(np.zeros(2 * len(v))))
        for column, direction in enumerate(reduced.embedding.T):
            rates = slope(lambda h, d=direction: np.array(list(values(h * d).values())), 0.02)
            own = np.array([linear.C[titles.index(title), column] for title in found])
            size = np.maximum(np.abs(rates), np.abs(rates).max() * 1e-3)
            assert np.all(np.abs(own - rates) <= 10.0 * DIGITS * size)
        direct = {title: np.zeros(len(linear.inputs)) for title in found}
        for title, row in reduced.direct.items():
            direct[title] = row
        for title, row in direct.items():
            assert linear.D[titles.index(title)] == pytest.approx(row, rel=1e-7, abs=1e-9), title

    @pytest.fixture(scope="class")
    def reduced(self, linear, loaded, loaded_run, plain_scene):
        slopes = bc.scene_derivatives(loaded, *(state_of(loaded_run)[k] for k in (1, 2, 0)))
        return Reduced(plain_scene, linear, *state_of(loaded_run), slopes.of_acceleration)


class Modes:
    """At an equilibrium near the start of the machine's scene."""

    @pytest.fixture(scope="class")
    def resting(self, machine):
        return machine.load_scene(**machine.resting)

    @pytest.fixture(scope="class")
    def modal(self, resting):
        return bc.linearise(resting, at="equilibrium")

    @pytest.fixture(scope="class")
    def at_rest(self, resting, modal):
        still = np.zeros(resting.robot.nv)
        slopes = bc.scene_derivatives(resting, modal.position, still).of_acceleration
        return Reduced(PlainDynamics(resting), modal, 0.0, modal.position, still, slopes)

    def test_forces_balance_at_the_equilibrium(self, modal, at_rest):
        assert modal.kind == "equilibrium" and not modal.velocity.any() and modal.residual < 1e-9
        weight = np.abs(at_rest.plain.tree.gravity_torque(modal.position)).max()
        inverse = np.linalg.inv(at_rest.plain.mass_matrix())
        assert np.abs(at_rest.acceleration).max() < 1e-8 * max(1.0, weight * np.abs(inverse).max())

    def test_eigenvalues_are_those_of_the_reduced_plain_equations(self, modal, at_rest):
        close(modal.A, at_rest.field, DIGITS)
        values = np.linalg.eigvals(at_rest.field)
        matched(modal.eigenvalues, values, 1e-6 * np.abs(values).max())
        assert modal.stable is bool((values.real < 1e-9 * np.abs(values).max()).all())

    def test_each_mode_is_a_solution_of_the_linear_equations(self, modal, at_rest):
        """x = Re(shape exp(λ t)), of which the largest entry is 1; frequency and damping are parts of λ."""
        sizes = [abs(mode.eigenvalue) for mode in modal.modes]
        assert sizes == sorted(sizes)
        count = len(at_rest.positions)
        for mode in modal.modes:
            close(
                modal.A @ mode.shape, mode.eigenvalue * mode.shape, 1e-9 * np.abs(modal.A).max() / abs(mode.eigenvalue)
            )
            for vector in (mode.shape, mode.displacement):
                assert vector[np.argmax(np.abs(vector))] == pytest.approx(1.0, rel=1e-12)
            whole = at_rest.embedding[: len(at_rest.acceleration), :count] @ mode.shape[:count]
            close(mode.displacement, whole / whole[np.argmax(np.abs(whole))], 1e-8)
            real, imaginary = mode.eigenvalue.real, mode.eigenvalue.imag
            assert mode.natural_frequency == pytest.approx(np.hypot(real, imaginary), rel=1e-14)
            assert mode.frequency == pytest.approx(imaginary / (2.0 * np.pi), rel=1e-14)
            assert mode.damping_ratio == pytest.approx(-real / np.hypot(real, imaginary), rel=1e-14, abs=1e-15)
            assert mode.oscillates is (imaginary > 0.0)
            assert mode.kind == kind_of(real, imaginary)
            assert mode.time_constant == (None if real == 0.0 else pytest.approx(1.0 / abs(real), rel=1e-14))

    def test_files_hold_the_matrices_and_eigenvalues(self, modal, tmp_path):
        modal.to_json(tmp_path / "modes.json")
        modal.to_mat(tmp_path / "modes.mat")
        data, mat = json.loads((tmp_path / "modes.json").read_text()), loadmat(tmp_path / "modes.mat")
        for key in "ABCD":
            assert np.array_equal(np.reshape(data[key], mat[key].shape), mat[key])
            assert np.array_equal(mat[key], getattr(modal, key))
        assert np.array_equal(mat["eigenvalues"].ravel(), modal.eigenvalues)
        pairs = [complex(*mode["eigenvalue"]) for mode in data["modes"]]
        assert pairs == [mode.eigenvalue for mode in modal.modes]
        assert [mode["frequency"] for mode in data["modes"]] == [mode.frequency for mode in modal.modes]
        assert data["stable"] is modal.stable and data["states"] == [list(state) for state in modal.states]
        for cells, mode in zip(modal.mode_rows(), modal.modes, strict=True):
            assert float(cells[2] or 0.0) == pytest.approx(mode.frequency, rel=1e-4, abs=1e-12)
            assert float(cells[3]) == pytest.approx(mode.damping_ratio, rel=1e-4, abs=1e-12)
            assert float(cells[4] or "inf") == pytest.approx(mode.time_constant or np.inf, rel=1e-4)
            value = complex(cells[1].replace(" ", "").replace("±", "+").replace("i", "j"))
            assert value == pytest.approx(mode.eigenvalue, rel=1e-5)

    def test_floquet_multipliers_of_rest_are_exponentials_of_the_eigenvalues(self, resting, modal):
        """Any time is a period; det Φ = exp(T trace A) is Liouville's formula."""
        start = {j.name: float(modal.position[j.q]) for j in resting.robot.joints if j.nv == 1}
        for joint in resting.robot.joints:
            if joint.kind == "floating":
                start[joint.name] = {"position": {"guess": modal.position[joint.q : joint.q + 3].tolist()}}
        found = bc.floquet(resting.with_overrides({"initial": start}), PERIOD)
        matched(found.multipliers, np.exp(modal.eigenvalues * PERIOD), 1e-9)
        sizes = np.abs(found.multipliers)
        assert np.all(np.diff(sizes) <= 1e-12 * sizes[0])  # the largest first
        assert np.linalg.det(found.monodromy) == pytest.approx(np.exp(PERIOD * np.trace(modal.A)), rel=1e-7)
        matched(found.exponents, modal.eigenvalues, 1e-5 * np.abs(modal.eigenvalues).max())
        assert found.stable is modal.stable and found.period == PERIOD and found.states == modal.states

    def test_root_loci_follow_the_eigenvalues_of_each_value(self, machine, resting, tmp_path):
        path, values = machine.locus
        found = bc.root_loci(resting, path, values, "equilibrium")
        assert found.values == tuple(values) and not found.failures
        single = [bc.linearise(resting.with_overrides({path: value}), "equilibrium") for value in values]
        for row, linear in zip(found.eigenvalues, single, strict=True):
            matched(row, linear.eigenvalues, 1e-9 * np.abs(row).max())
        steps = np.abs(np.diff(found.eigenvalues, axis=0))
        for k, pair in enumerate(zip(found.eigenvalues[:-1], found.eigenvalues[1:], strict=True)):
            away = np.abs(pair[0][:, None] - pair[1][None])
            assert steps[k].sum() <= away[linear_sum_assignment(away)].sum() * (1.0 + 1e-9)
        found.to_csv(tmp_path / "loci.csv")
        with (tmp_path / "loci.csv").open(newline="") as file:
            rows = list(csv.reader(file))[1:]
        table = np.array([[float(cell) for cell in row[1:]] for row in rows])
        assert np.array_equal(table[:, ::2] + 1j * table[:, 1::2], found.eigenvalues)


# ---- the reduction in NumPy


class Reduced:
    """Independent displacements δ_I and velocities v_I: δ = T δ_I, v = N v_I + W δ_I (docs/theory/derivatives.md)."""

    def __init__(self, plain, linear, t, q, v, slopes):
        """`slopes` are the derivatives of the accelerations, which are compared with differences elsewhere."""
        self.plain, nv = plain, len(v)
        names = coordinates(plain.robot)
        states = [name for name, _ in linear.states]
        self.positions = [names.index(name) for name in states if not name.endswith(" rate")]
        self.velocities = [names.index(name.removesuffix(" rate")) for name in states if name.endswith(" rate")]
        kept = rows_kept(plain, t, q, v)

        def rows():
            found = [plain.constraint(entry)[0] for entry in plain.scene_data.get("constraints", ())]
            return np.vstack([np.zeros((0, nv)), *found])[kept]

        def rates(h, step):
            plain.at(t, plain.tree.displaced(q, h * step), v)
            return rows() @ v

        kinds = [entry["kind"] for entry in plain.scene_data.get("constraints", ())]
        by_position = np.array([slope(lambda h, e=e: rates(h, e), 0.02) for e in np.eye(nv)]).T.reshape(-1, nv)
        self.acceleration = plain.at(t, q, v).accelerations()[0]
        jacobian = rows()
        holonomic = jacobian[:1] if "rolling_disk" in kinds else jacobian
        T, N = spanned(holonomic, self.positions, nv), spanned(jacobian, self.velocities, nv)
        W, dependent = np.zeros((nv, T.shape[1])), [k for k in range(nv) if k not in self.velocities]
        if len(jacobian):
            W[dependent] = np.linalg.lstsq(jacobian[:, dependent], -by_position @ T, rcond=None)[0]
        self.embedding = np.block([[T, np.zeros((nv, N.shape[1]))], [W, N]])
        whole = np.block([[-bracket(plain.robot, v), np.eye(nv)], [slopes.position, slopes.velocity]])
        chosen = [*self.positions, *(nv + k for k in self.velocities)]
        self.field = (whole @ self.embedding)[chosen]
        mass, m = plain.mass_matrix(), len(jacobian)
        inverse = np.linalg.inv(np.block([[mass, -jacobian.T], [jacobian, np.zeros((m, m))]]))
        columns = [plain.robot.joint(name.rpartition(" ")[0]).v for name, _ in linear.inputs]
        self.by_torque = inverse[self.velocities][:, columns]
        self.direct = {}
        for joint in plain.robot.joints:
            if f"{joint.name}_acceleration" in [title for title, _ in linear.outputs]:
                self.direct[f"{joint.name}_acceleration"] = inverse[joint.v, columns]
        for k, title in enumerate(multiplier_titles(plain)[j] for j in kept):
            if title in [name for name, _ in linear.outputs]:
                self.direct[title] = inverse[nv + k, columns]


def spanned(rows, independent, nv):
    """The null space (nv, k) of rows that is the identity on the independent coordinates."""
    basis = null_space(rows, rcond=1e-9) if len(rows) else np.eye(nv)
    return basis @ np.linalg.inv(basis[independent])


def bracket(robot, v):
    """ad(v): δ̇ = δv − ad(v) δ for displacements of a free body in its own axes, 0 for joints."""
    found = np.zeros((robot.nv, robot.nv))
    for joint in robot.joints:
        if joint.kind == "floating":
            linear, angular = (cross(v[joint.v + k : joint.v + k + 3]) for k in (0, 3))
            own = slice(joint.v, joint.v + 6)
            found[own, own] = np.block([[angular, linear], [np.zeros((3, 3)), angular]])
    return found


def cross(w):
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def coordinates(robot):
    """The names of the degrees of freedom (nv)."""
    found = []
    for joint in robot.joints:
        parts = ("x", "y", "z", "rotation x", "rotation y", "rotation z")
        found += [joint.name] if joint.nv == 1 else [f"{joint.name} {part}" for part in parts]
    return found


def multiplier_titles(plain):
    """The outputs of all rows of the constraints."""
    found = []
    for entry in plain.scene_data.get("constraints", ()):
        labels = {
            "point": ("x", "y", "z"), "distance": ("push",),
            "rolling_disk": ("normal", "friction forwards", "friction sideways"),
        }[entry["kind"]]  # fmt: skip
        found += [f"constraint_{entry['name']} {label}" for label in labels]
    return found


def formulas(plain):
    """Outputs of the loaded scene by their formulas, by title, at the state that is set."""
    hook, t = plain.frame("hook"), plain.t
    found = {f"hook_position {x}": hook.position[k] for k, x in enumerate("xyz")}
    found |= {f"hook_velocity {x}": hook.velocity[k] for k, x in enumerate("xyz")}
    found |= {f"hook_angular_velocity {x}": hook.angular_velocity[k] for k, x in enumerate("xyz")}
    found |= {f"hook_rotation r{i + 1}{j + 1}": hook.rotation[i, j] for i in range(3) for j in range(3)}
    kinetic, potential = plain.energies()
    found |= {"energy_kinetic": kinetic, "energy_potential": potential, "energy_total": kinetic + potential}
    for entry in plain.scene_data["forces"]:
        shown = np.atleast_1d(plain.force(entry)[2])
        parts = ("",) if len(shown) == 1 else (" x", " y", " z", " rx", " ry", " rz")
        found |= {f"force_{entry['name']}{part}": value for part, value in zip(parts, shown, strict=True)}
    acceleration, multipliers = plain.accelerations()
    outputs = plain.scene_data["outputs"]
    for joint in plain.robot.joints:
        if f"{joint.name}_acceleration" in outputs:
            q, v = plain.q[joint.q], plain.v[joint.v]
            parts = ("position", q), ("velocity", v), ("acceleration", acceleration[joint.v])
            found |= {f"{joint.name}_{what}": value for what, value in parts}
    found |= dict(zip(multiplier_titles(plain), multipliers, strict=True))
    found["mixed"] = 2.0 * hook.velocity[0] ** 2 - 3.0 * np.sin(hook.position[2]) * t + np.sqrt(1.0 + t**2)
    return found


def kind_of(real, imaginary):
    if imaginary > 0.0:
        return "oscillation" if real == 0.0 else "growing oscillation" if real > 0.0 else "decaying oscillation"
    return "neutral" if real == 0.0 else "growth" if real > 0.0 else "decay"


def matched(found, expected, bound):
    """Whether two sets of complex numbers agree one by one."""
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    away = np.abs(found[:, None] - expected[None])
    assert away[linear_sum_assignment(away)].max(initial=0.0) <= bound
