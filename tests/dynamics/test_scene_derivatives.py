"""Derivatives of accelerations and multipliers against extrapolated differences of the compiled equations.

The compiled equations (system.py) are solved by another factorisation than the derivatives, and differenced at
displaced states. Bound: 1e-10 of the largest entry of each block; a scene that needs more says why.
"""

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.analysis.operating_point import independent_states, operating_point
from bellcrank.analysis.symmetries import adjoint, project, symmetries_of
from bellcrank.dynamics.equations.linear_equations import equation_code
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.dynamics.postures.consistent_start import consistent_start, displaced
from tests.support.extrapolated import slope

MIMIC = """<robot name="mimic"><link name="base"/>
  {a}{b}{c}
  <joint name="first" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
  <joint name="second" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0.4 0 0"/><axis xyz="0 0.6 0.8"/>
    <limit lower="-3" upper="3" effort="9" velocity="9"/><mimic joint="first" multiplier="-1.7" offset="0.2"/></joint>
  <joint name="ball" type="spherical"><parent link="b"/><child link="c"/><origin xyz="0.3 0 0.1"/></joint>
</robot>"""
BODY = (
    '<link name="{0}"><inertial><origin xyz="0.2 0.03 0.01"/><mass value="1.5"/>'
    '<inertia ixx="0.01" ixy="0.001" ixz="0.002" iyy="0.03" iyz="0" izz="0.025"/></inertial></link>'
)
FORCED = """name: Forced mimic
urdf: mimic.urdf
friction: {first: {viscous: 0.4, coulomb: 0}}
forces:
  - {kind: friction, joint: first, coulomb: 0.7, width: 0.5}
  - {kind: joint_spring, joint: first, stiffness: 12, rest: 0.3, damping: 0.2}
  - {kind: torque, joint: first, file: torque.csv, interpolation: cubic}
  - {kind: wrench, frame: c, force: [3, -2, 5], torque: [0.2, 0.1, -0.3], expressed_in: frame}
control: [{kind: pd, joint: first, target: {first: 0.4}, kp: 30, kd: 2}]
parameters: {tool: {value: 1.5, sets: [link.c.mass]}, gain: {value: 30, sets: [control.pd.kp]}}
initial: {first: 0.5, ball: {rpy: [0.2, -0.4, 0.7], angular_velocity: [0.3, -0.2, 0.5]}, velocity: {first: 0.8}}
"""


def forced(folder):
    bodies = {name: BODY.format(name) for name in "abc"}
    (folder / "mimic.urdf").write_text(MIMIC.format(**bodies))
    rows = "\n".join(f"{0.25 * k},{np.sin(0.25 * k):.12f}" for k in range(9))
    (folder / "torque.csv").write_text(f"time [s],first torque [N m]\n{rows}\n")
    (folder / "forced.yaml").write_text(FORCED)
    return bc.load_scene(folder / "forced.yaml")


SCENES = (
    "pendulum", "planar_2r_tracking", "spring_pendulum", "four_bar", "rolling_disk", "rolling_disk_six", "five_bar",
    "planar_delta", "delta", "ur5_falling", "n_four_bar_2",
)  # fmt: skip
REDUNDANT = ("bricard", "two_wheeler")
BOUND = 1e-10
# Times, s, of a run, so that velocities are not zero: between two samples of a motion, where its signal is smooth. The
# four-bar is tried where it is no longer nearly flat, since differences of 0.05 rad would cross its singular posture.
TIMES = {"four_bar": 8.003}
TIME = 0.203


class Compiled:
    """v̇ and λ of the compiled equations as one vector."""

    def __init__(self, scene, time):
        self.scene, self.time, self.system = scene, time, system_of(scene)
        self.nv = scene.robot.nv

    def __call__(self, q, v, time=None, parameters=None):
        scene = self.scene if parameters is None else self.scene.with_overrides(parameters)
        system, time = self.system, self.time if time is None else time
        x = np.concatenate([q, v, np.zeros(system.size - len(q) - len(v))])
        arguments = np.array([time]), x, scene.signals_at(np.array([time]))[0], system_parameters(scene)
        if not scene.constraints:
            return system.rhs(*arguments)[len(q) : len(q) + self.nv]
        rate = system.fallback(*arguments)[len(q) : len(q) + self.nv]
        return np.concatenate([rate, system.constraint(*arguments)[0]])


def close(found, expected, bound):
    for part, reference in zip(found, expected, strict=True):
        size = np.abs(reference).max(initial=0.0)
        assert np.abs(part - reference).max(initial=0.0) <= bound * max(size, 1e-3)


def state_of(scene, time):
    if scene.name == "Forced mimic":
        return consistent_start(scene)
    run = bc.simulate(scene, duration=time, samples=2)
    return run.position[-1], run.velocity[-1]


@pytest.mark.tier2
@pytest.mark.parametrize("name", [*SCENES, "forced"])
def test_derivatives_are_those_of_the_compiled_equations(name, tmp_path):
    scene = forced(tmp_path) if name == "forced" else bc.load_scene(name)
    bound, time = BOUND, TIMES.get(name, TIME)
    q, v = state_of(scene, time)
    compiled, found = Compiled(scene, time), bc.scene_derivatives(scene, q, v, time)
    nv = scene.robot.nv
    base = compiled(q, v)
    close([found.acceleration, found.multipliers], [base[:nv], base[nv:]], 1e-11)
    by_q = np.stack([slope(lambda h, e=e: compiled(displaced(scene, q, h * e), v)) for e in np.eye(nv)], axis=1)
    close([found.of_acceleration.position, found.of_multipliers.position], [by_q[:nv], by_q[nv:]], bound)
    by_v = np.stack([slope(lambda h, e=e: compiled(q, v + h * e)) for e in np.eye(nv)], axis=1)
    close([found.of_acceleration.velocity, found.of_multipliers.velocity], [by_v[:nv], by_v[nv:]], bound)
    by_t = slope(lambda h: compiled(q, v, time=time + h), first=0.002)
    close([found.of_acceleration.time, found.of_multipliers.time], [by_t[:nv], by_t[nv:]], bound)
    for k, (parameter, value) in enumerate(zip(scene.parameters, scene.parameter_values, strict=True)):
        size = abs(value) or 1.0
        by_p = slope(lambda h, p=parameter, x=value, s=size: compiled(q, v, parameters={p: x + h * s})) / size
        slopes = [found.of_acceleration.parameters[:, k], found.of_multipliers.parameters[:, k]]
        close(slopes, [by_p[:nv], by_p[nv:]], bound)


@pytest.mark.tier2
@pytest.mark.parametrize("name", REDUNDANT)
def test_with_redundant_rows_derivatives_hold_along_what_the_constraints_allow(name):
    """Displaced states are projected onto the constraints, so that the redundant rows agree there. Only v̇ is compared:
    which λ is the least depends on a metric that changes with the state in the compiled equations.
    """
    scene = bc.load_scene(name)
    q, v = state_of(scene, TIME)
    found = bc.scene_derivatives(scene, q, v, TIME)
    point = operating_point(scene, TIME, q, v, symmetries_of(scene, TIME, q, v))
    nv, states = scene.robot.nv, independent_states(point)
    close([found.acceleration], [Compiled(scene, TIME)(q, v)[:nv]], 1e-10)
    by = np.hstack([found.of_acceleration.position, found.of_acceleration.velocity]) @ states.embedding
    columns = []
    for direction in states.embedding.T:

        def moved(h, d=direction):
            return project(scene, TIME, displaced(scene, q, h * d[:nv]), v + h * d[nv:])[2].acceleration

        columns.append(slope(moved, first=0.01))
    close([by], [np.stack(columns, axis=1)], BOUND)


def test_torques_change_accelerations_by_the_inverse_of_the_mass_matrix_on_what_constraints_allow():
    scene = bc.load_scene("five_bar")
    found = bc.scene_derivatives(scene)
    system, (q, v) = system_of(scene), consistent_start(scene)
    x = np.concatenate([q, v, np.zeros(system.size - len(q) - len(v))])
    jacobian, mass = system.constraint_metric(np.zeros(1), x, np.zeros(0), system_parameters(scene))
    n, m = len(mass), len(jacobian)
    whole = np.linalg.inv(np.block([[mass, -jacobian.T], [jacobian, np.zeros((m, m))]]))
    close([found.of_acceleration.torque, found.of_multipliers.torque], [whole[:n, :n], whole[n:, :n]], 1e-12)
    torque = np.arange(1.0, 1.0 + n)
    moved = bc.scene_derivatives(scene, torque=torque)
    expected = found.acceleration + found.of_acceleration.torque @ torque
    assert np.allclose(moved.acceleration, expected, rtol=1e-12, atol=1e-12)


def test_a_displacement_of_a_free_base_moves_with_the_base():
    """δ̇ = δv − ad(v) δ, against the difference of two free motions of a rigid body, integrated apart."""
    scene = bc.load_scene("rolling_disk")
    robot, random = scene.robot, np.random.default_rng(1)
    v, step, change = (random.normal(size=robot.nv) for _ in range(3))
    q = np.array([0.1, -0.2, 0.3, 0.0, 0.0, 0.0, 1.0])

    def carried(h):
        """log of q(h)⁻¹ q'(h), both moved for a time h at constant velocity."""
        import pinocchio as pin

        model = robot.model
        size = 1e-6
        first = pin.integrate(model, q, h * v)
        second = pin.integrate(model, pin.integrate(model, q, size * step), h * (v + size * change))
        back = pin.integrate(model, pin.integrate(model, q, -size * step), h * (v - size * change))
        return (pin.difference(model, first, second) - pin.difference(model, first, back)) / (2.0 * size)

    assert np.allclose(slope(carried), change - adjoint(robot, v) @ step, atol=1e-8)


def test_the_derivative_code_is_kept_with_the_scene():
    scene = bc.load_scene("pendulum")
    assert equation_code(scene) is equation_code(scene)
