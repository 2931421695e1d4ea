"""Every public function answers wrong arguments with one sentence that names the argument."""

import datetime
import inspect
import io
import math
import re
import shutil
import traceback
from dataclasses import fields
from functools import cache, partial
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pytest

import bellcrank as bc
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.inverse.scene_inverse_dynamics import SceneInverseDynamics
from bellcrank.errors import BellcrankError, InputError
from tests.support.public_names import NAMES
from tests.support.public_names import public as public_name

# Classes that functions of the interface make, and which have no checks of their own: their methods are called here.
MADE_BY = {
    "Mobility": "mobility",
    "SceneDerivatives": "scene_derivatives",
    "Slopes": "scene_derivatives",
    "Linearisation": "linearise",
    "Mode": "linearise",
    "RootLoci": "root_loci",
    "FloquetModes": "floquet",
    "Robot": "load_robot",
    "Scene": "load_scene",
    "Trajectory": "simulate",
    "RunSensitivity": "simulate",
    "EventSensitivity": "simulate",
    "SizingSensitivity": "size",
    "JointSensitivity": "size",
    "PreparedSimulation": "prepare",
    "PreparedRun": "prepare",
    "Sizing": "size",
    "Sweep": "sweep",
    "Sensitivity": "sobol_indices",
    "SampleStatistics": "sobol_indices",
    "Catalogue": "load_catalogue",
    "Selection": "select",
    "DriveVerdicts": "judge",
    "SelectionVerification": "verify_selection",
    "FastestMotion": "time_optimal",
    "LimitCost": "time_optimal",
    "SpeedFactor": "speed_factor",
    "RepeatedCycle": "repeated_cycle",
    "JointPath": "joint_path",
    "Optimum": "optimise",
    "ParetoFront": "pareto_front",
    "DesignSelection": "select_designs",
    "Synthesis": "synthesise",
}
# The methods that all results have.
RESULT_METHODS: dict[str, dict[str, Any]] = {
    "table": {}, "as_dict": {}, "to_csv": {"path": "r.csv"}, "to_json": {"path": "r.json"}, "to_pandas": {},
}  # fmt: skip
ERRORS = ("BellcrankError", "InputError", "NotSavedError", "UnreachableError", "CompileError")
# What a message may call an argument, besides its own name.
WORDS = {
    "given": ("conditions",),
    "name": (
        "joint",
        "frame",
        "link",
        "motion",
        "measure",
        "constraint",
        "output",
        "event",
        "sensitivity",
        "motor",
        "column",
        "gear",
        "product",
        "axis",
    ),
    "link": ("link",),
    "algorithm": ("algorithm",),
    "path_or_name": ("scene", "robot", "robot configuration", "config"),
    "scene": ("scene", "robot"),
    "robot": ("robot", "scene", "config"),
    "path": ("robot", "picture format", "file", "folder"),
    "motion": ("motion",),
    "motions": ("motion",),
    "more": ("more", "motion"),
    "measures": ("measure",),
    "measure": ("measure",),
    "limit": ("limit", "measure"),
    "limits": ("limit", "measure"),
    "overrides": ("override",),
    "joints": ("joint",),
    "payloads": ("payload",),
    "thing": ("run", "report", "replay", "show", "there is no such file"),
    "source": ("run", "report", "replay", "show", "there is no such file"),
    "over": ("replay", "there is no such file"),
    "trace": ("frame",),
    "actuated": ("joint", "actuated"),
    "independent": ("joint", "independent"),
    "v": ("velocity",),
    "q": ("position",),
    "a": ("acceleration",),
    "t": ("time", "argument 'q'"),
    "time": ("position",),
    "times": ("time",),
    "rated_torque": ("rated torque",),
    "rated_speed": ("rated speed",),
    "center": ("path",),
    "radius": ("path",),
    "end": ("path",),
    "begin": ("path",),
    "allow_massless": ("link",),
    "inputs": ("takes vectors",),
    "what": ("picture",),
    "names": ("frame", "parameter"),
    "curve_points": ("curve",),
    "text": ("'text'", "column", "row", "CSV", "header", "file"),
    "frames": ("frame",),
    "friction": ("friction", "joint"),
    "rotor_inertia": ("rotor_inertia", "joint"),
    "position": ("position", "posture", "joint"),
    "positions": ("position", "posture", "joint"),
    "start": ("start", "posture", "joint"),
    "values": ("posture", "joint", "values"),
    "set_masses": ("mass",),
    "vary": ("vary", "sweep", "parameter"),
    "variables": ("optimise", "pareto_front", "override"),
    "tolerances": ("optimise", "pareto_front"),
    "sample": ("distribution", "study"),
    "frame": ("frame",),
    "makers": ("maker",),
    "kinds": ("kind",),
    "ids": ("product",),
    "exclude": ("product",),
    "folders": ("file", "folder", "catalogue"),
    "folder": ("file", "folder"),
    "shipped": ("is also at",),
    "catalogue": ("file", "folder"),
    "keep": ("axis",),
    "longest": ("links of at most",),
    "fastest": ("fastest", "motion"),
    "parameters": ("parameter",),
    "reference_temperature": ("reference temperature",),
}


class Awkward:
    """An object that raises where it is asked for a text or a number."""

    def _refuse(self, *_: Any) -> Any:
        raise RuntimeError("asked")

    __repr__ = __str__ = __float__ = __int__ = __index__ = __complex__ = _refuse


def recursive() -> list[Any]:
    """A list that holds itself."""
    held: list[Any] = []
    held.append(held)
    return held


# Made anew for each call, since a generator is spent by one.
ODD: dict[str, Any] = {
    "None": lambda: None,
    "True": lambda: True,
    "-1": lambda: -1,
    "0.5": lambda: 0.5,
    "nan": lambda: math.nan,
    "inf": lambda: -math.inf,
    "1e308": lambda: 1e308,
    "1e12": lambda: 10**12,
    "huge": lambda: 10**400,
    "complex": lambda: 1j,
    "text": lambda: "x",
    "empty": lambda: "",
    "null": lambda: "a\0b",
    "long": lambda: "x" * 70000,
    "surrogate": lambda: "\ud800",
    "bytes": lambda: b"x",
    "list": lambda: [1.0, 2.0, 3.0],
    "digits": lambda: ["1", "2"],
    "nothing": lambda: [],
    "nan list": lambda: [math.nan, 0.0],
    "None list": lambda: [None, None],
    "bools": lambda: [True, False],
    "recursive": recursive,
    "mapping": lambda: {"a": 1.0},
    "keys": lambda: {1: None},
    "masked": lambda: np.ma.masked_array([0.1, 0.2], [True, False]),
    "objects": lambda: np.array([None, "a"], dtype=object),
    "cube": lambda: np.zeros((2, 3, 2)),
    "short": lambda: np.zeros(0),
    "date": lambda: datetime.datetime(2020, 1, 1),
    "numpy date": lambda: np.datetime64("2020-01-01"),
    "generator": lambda: (x for x in (1, 2)),
    "awkward": Awkward,
    "awkward list": lambda: [Awkward()],
    "module": lambda: math,
}


def casadi_square() -> Any:
    """A function that can be compiled."""
    x = casadi.SX.sym("x", 1)
    return casadi.Function("square", [x], [x * x])


@cache
def examples() -> dict[str, tuple[Any, dict[str, Any]]]:
    """Every public function and method with arguments that it takes, cheap ones; files go into the working folder."""
    robot = bc.load_robot("planar_2r")
    pendulum, four_bar = bc.load_scene("pendulum"), bc.load_scene("four_bar", {"motions.unfold.samples": 21})
    linkage, linear = Linkage(four_bar), bc.linearise(pendulum)
    hanging = bc.load_scene("pendulum", {"initial.swing": 0.0})
    loci, periodic = bc.root_loci(pendulum, "initial.swing", [0.1, 0.2]), bc.floquet(hanging, 1.0)
    actuator = bc.Actuator(100.0, 1.0, 2.0, 300.0, 400.0)
    payload = bc.Payload(1.0, "tip")
    motion = bc.waypoints(robot, [0.0, 1.0], [[0.0, 0.0], [1.0, 1.0]], samples=11)
    run = bc.simulate(pendulum, duration=0.01, samples=3, sensitivities=["initial.swing"])
    locking = bc.simulate(four_bar, samples=3, sensitivities=["crank_length"]).sensitivity("crank_length")
    closed_run = bc.simulate(four_bar, duration=0.01, samples=3)
    sticking = bc.simulate(
        "pendulum",
        0.1,
        overrides={"joints": {"swing": {"dry_friction": {"coulomb": 20.0}, "stop": {"lower": -2.0, "upper": 2.0}}}},
    )
    sizing = bc.size(robot, motion, {"shoulder": actuator})
    sized = bc.size(four_bar, "unfold")
    swept = bc.sweep(pendulum, {"simulate.rtol": [1e-6, 1e-7]}, overrides={"simulate.duration": 0.01})
    found = bc.sobol_indices(pendulum, {"simulate.rtol": "uniform(1e-7, 1e-6)"}, n=2,
                             overrides={"simulate.duration": 0.01})  # fmt: skip
    whole = linkage.motion("unfold")
    few = slice(0, 3)
    t, tree = whole.time[few], (whole.position[few], whole.velocity[few], whole.acceleration[few])
    inverse = bc.scene_inverse_dynamics(pendulum, bc.dwell(pendulum.robot, [0.1], 1.0))
    q, v, a = np.array([0.1, 0.2]), np.array([0.3, 0.4]), np.array([0.5, 0.6])
    bc.write_motion(motion, "given.csv")
    run.save("given.npz")
    states = {"q": q, "v": v, "a": a}
    closed_states = {"t": t, "q": tree[0], "v": tree[1], "a": tree[2]}
    multipliers = linkage.torques(t, *tree)[1]
    shipped = bc.load_catalogue()
    small = shipped.only(["maxon_607930", "maxon_397172", "apex_af042_50", "apex_af060_50"])
    motor, gear = small.motors[0], small.gears[0]
    selection = bc.select("geared_pendulum", catalogue=small)
    bc.write_catalogue([motor], [gear], "rows")
    belt = bc.CoupledTransmission(("swing",), ("belt_motor",), ((2.0,),))
    followed = bc.verify_selection("manutec_axis", settle=0.1)
    chosen, verdicts = bc.Actuator.of(motor, gear), bc.judge(robot, motion, {"shoulder": actuator})
    limits = {"duration": 1.0, "samples": 11, "profile": "quintic", "orientation": None, "speed": None,
              "acceleration": None, "jerk": None, "coordinates": ("x", "y"), "name": "own"}  # fmt: skip
    start = {"shoulder": 1.2, "elbow": -1.0}
    one_motor = {"scene": pendulum, "motion": bc.dwell(pendulum.robot, [0.1], 1.0), "actuated": ["swing"],
                 "independent": ["swing"], "overrides": None, "trust": []}  # fmt: skip
    simulated = {"overrides": None, "max_evaluations": 3000}
    prepared = bc.prepare(four_bar, samples=3)
    joint_path = bc.joint_path(robot, [{}, {"elbow": 1.0}])
    fast, factor = bc.time_optimal(robot, motion, grid=20, costs=False), bc.speed_factor(robot, motion)

    near = {
        "scene": pendulum, "variables": {"initial.swing": (0.1, 0.2)}, "minimise": "end.swing", "maximise": None,
        "limits": "end.time <= 100 s", "size": False, "fastest": False,
        "start": {"initial.swing": 0.15}, "samples": 2, "starts": 1,
        "seed": 0, "tolerances": {"initial.swing": "uniform(-0.01, 0.01)"}, "robust": "worst",
        "folder": None, "restart": False,
        "overrides": {"simulate.duration": 0.01}, "threads": 1, "workers": None, "scheduler": None, "progress": None,
        "trust": [],
    }  # fmt: skip
    best = bc.optimise(**near)
    between = near | {"variables": {"initial.swing": {"sizes": [0.1, 0.2]}}, "start": {"initial.swing": 0.1},
                      "points": 3, "maximise": "end.swing.velocity"}  # fmt: skip
    front = bc.pareto_front(**between)
    chosen_designs = {
        "scene": "geared_pendulum", "vary": {"link.pendulum.mass": [2.0]}, "motions": None, "catalogue": small,
        "objective": "mass", "conditions": bc.Conditions(), "keep": None, "exclude": (), "makers": (), "feedback": True,
        "candidates": 2, "effort": 10, "samples": None, "payloads": (), "allow_massless": (),
        "overrides": {"payloads": []},
        "progress": None, "trust": (),
    }  # fmt: skip
    designs = bc.select_designs(**chosen_designs)
    corners = {"linkage": "four_bar", "points": [(0, 0), (1, 0.2), (1.5, 1), (1, 1.5), (0, 1)], "timing": 1.2,
               "directions": None, "function": None, "transmission_angle": 0.5, "longest": None, "seed": 0,
               "progress": None}  # fmt: skip
    linkages = bc.synthesise(**corners)
    outputs = bc.synthesise("four_bar", function=[(0, 0), (0.5, 0.2), (1, 0.5), (1.2, 0.7), (1.5, 1)])

    def of(thing: Any, **methods: dict[str, Any]) -> dict[str, tuple[Any, dict[str, Any]]]:
        kind = type(thing).__name__
        return {f"{kind}.{name}": (getattr(thing, name), arguments) for name, arguments in methods.items()}

    made: dict[str, tuple[Any, dict[str, Any]]] = {
        "load_robot": (bc.load_robot, {
            "path": "planar_2r", "gravity": (0, -9.81, 0), "floating_base": False, "friction": "urdf",
            "payloads": [payload], "rotor_inertia": {"elbow": 0.1},
            "frames": {"mine": ("link_1", (0.1, 0, 0), (0, 0, 0))}, "clean": True, "friction_width": 1e-3,
            "xacro_args": {}, "trust": ["."]}),
        "Payload": (bc.Payload, {"mass": 1.0, "frame": "tip", "cg": (0, 0, 0), "inertia": (1, 0, 1, 0, 0, 1)}),
        "Motion": (bc.Motion, {
            "joints": robot.joints, "time": motion.time, "position": motion.position, "velocity": motion.velocity,
            "acceleration": motion.acceleration, "name": "own", "notes": ("a note",), "position_noise": (0.0, 0.0),
            "speed_noise": (0.0, 0.0), "forms": (), "derived_from": ""}),
        "circle": (bc.circle, {"robot": robot, "frame": "tip", "center": (1.2, 1.2, 0), "radius": 0.2, "start": start,
                               "normal": (0, 0, 1), "turns": 1.0, **limits}),
        "line": (bc.line, {"robot": robot, "frame": "tip", "end": (1.3, 0.9, 0), "start": start, "begin": None,
                           **limits}),
        "waypoints": (bc.waypoints, {"robot": robot, "times": [0.0, 1.0], "positions": [[0, 0], {"elbow": 1.0}],
                                     "samples": 11, "name": "own"}),
        "tool_path": (bc.tool_path, {
            "robot": robot, "frame": "tip", "points": [(1.3, 0.9, 0), {"to": (1.2, 1.2, 0), "blend": 0.05}],
            "acceleration": 1.0, "speed": 1.0, "jerk": 10.0, "blend": 0.1, "profile": "s_curve", "start": start,
            "begin": None, "orientation": None, "coordinates": ("x", "y"), "samples": 11, "name": "own"}),
        "point_to_point": (bc.point_to_point, {
            "robot": robot, "positions": [[0, 0], {"elbow": 1.0}], "speed": {"elbow": 2.0}, "acceleration": 5.0,
            "jerk": {"elbow": 50.0}, "profile": "s_curve", "blend": 0.1, "share": 0.5, "samples": 11, "name": "own"}),
        "dwell": (bc.dwell, {"robot": robot, "position": [0.0, 0.0], "duration": 1.0, "name": "own"}),
        "join": (lambda motions, name: bc.join(motion, motions, name=name),
                 {"motions": bc.dwell(robot, [1.0, 1.0], 1.0), "name": None}),
        "read_motion": (bc.read_motion, {"robot": robot, "path": "given.csv", "name": "own", "text": None}),
        "write_motion": (bc.write_motion, {"motion": motion, "path": "written.csv", "torque": np.zeros((11, 2)),
                                           "more": {("own", "W"): np.zeros(11)}}),
        "load": (bc.load, {"path_or_name": "planar_2r", "overrides": {"gravity": [0, 0, 0]}, "trust": ["."]}),
        "Actuator": (bc.Actuator, {
            "ratio": 100.0, "rated_torque": 1.0, "peak_torque": 2.0, "rated_speed": 300.0, "max_speed": 400.0,
            "efficiency": 0.9, "rotor_inertia": 1e-4, "gear_inertia": 1e-5, "safety_factor": 1.2,
            "motor_efficiency": 0.9, "curve": ((0.0, 2.0), (400.0, 0.0))}),
        "size": (bc.size, {"robot": robot, "motions": [motion], "actuators": {"shoulder": actuator},
                           "mass_tolerance": 0.1,
                           "payloads": [payload], "allow_massless": [], "overrides": None, "trust": []}),
        "MotionLimits": (bc.MotionLimits, {"speed": {"elbow": 2.0}, "acceleration": "none", "jerk": "none",
                                           "torque": "urdf", "actuators": True, "tool": "tip", "tool_speed": 0.5,
                                           "tool_acceleration": 2.0, "tool_angular_speed": 1.0,
                                           "tool_angular_acceleration": 3.0}),
        "joint_path": (bc.joint_path, {"robot": robot, "positions": [{}, {"elbow": 1.0}], "parameters": [0.0, 1.0],
                                       "blend": 0.0}),
        "time_optimal": (bc.time_optimal, {
            "robot": robot, "path": motion, "limits": None, "grid": 20, "costs": False, "payloads": [payload],
            "overrides": None, "trust": [], "progress": None}),
        "speed_factor": (bc.speed_factor, {"robot": robot, "motion": motion, "limits": None, "payloads": [payload],
                                           "overrides": None, "trust": []}),
        "repeated_cycle": (bc.repeated_cycle, {
            "robot": robot, "motion": motion, "limit": "rms", "by": "pause", "actuators": {"shoulder": actuator},
            "payloads": [payload], "overrides": None, "trust": []}),
        **of(fast, plot={"path": "f.png"}),
        **of(factor, plot={"path": "k.png"}, scaled={"factor": 0.5}),
        **of(joint_path, at={"s": [0.1, 0.2]}, turning_points={}),
        **of(bc.MotionLimits(), of_joints={"key": "speed", "robot": robot}),
        "load_scene": (bc.load_scene, {"path_or_name": "pendulum", "overrides": {"simulate.rtol": 1e-6},
                                       "trust": ["."]}),
        "Settings": (bc.results.Settings, {
            "duration": 1.0, "solver": "RK45", "rtol": 1e-6, "atol": 1e-6, "step": 0.1, "first_step": 0.1,
            "max_step": 0.1, "samples": 11, "max_evaluations": 1000, "error_bound": 1e-3,
            "stabilisation": "none"}),
        "simulate": (bc.simulate, {
            "scene": pendulum, "duration": 0.01, "solver": "RK45", "rtol": 1e-6, "atol": 1e-6, "step": None,
            "times": [0.0, 0.01], "samples": 3, "first_step": 1e-3, "max_step": 0.01, "stabilisation": "none",
            "progress": print, "checkpoint": "kept.npz", "checkpoint_every": 5.0,
            "sensitivities": [], "controller": None, "sample_time": None, "trust": [], **simulated}),
        "prepare": (bc.prepare, {
            "scene": pendulum, "duration": 0.01, "solver": "RK45", "rtol": 1e-6, "atol": 1e-6, "step": None,
            "samples": 3, "first_step": 1e-3, "max_step": 0.01, "stabilisation": "none", "trust": [], **simulated}),
        "PreparedSimulation.trajectory": (prepared.trajectory, {"values": {"crank_length": 1.22}}),
        "PreparedRun.trajectory": (prepared().trajectory, {}),
        "load_run": (bc.load_run, {"path": "given.npz", "trust": ["."]}),
        "sweep": (bc.sweep, {"scene": pendulum, "vary": {"simulate.rtol": "uniform(1e-6, 1e-5)"}, "sample": 4,
                             "size": False, "fastest": False, "method": "random", "seed": 1, "threads": 1,
                             "workers": None,
                             "scheduler": None,
                             "folder": "study", "restart": True, "overrides": {"simulate.duration": 0.01},
                             "progress": None, "sobol": None, "checking": None, "on_checkpoint": None,
                             "checkpoint_every": 5.0,
                             "trust": []}),
        "sobol_indices": (bc.sobol_indices, {
            "scene": pendulum, "vary": {"simulate.rtol": "uniform(1e-7, 1e-6)"}, "n": 2, "seed": 0, "threads": 1,
            "overrides": {"simulate.duration": 0.01}, "progress": None, "workers": None, "scheduler": None,
            "folder": None}),
        "optimise": (bc.optimise, near),
        **of(best, plot={"path": None},
             write_config={"path": "o.yaml"}),
        "pareto_front": (bc.pareto_front, between),
        **of(front, plot={"path": None},
             write_configs={"folder": "front"}),
        "synthesise": (bc.synthesise, corners),
        **of(outputs, output_differences={"linkage": 0}),
        **of(linkages, plot={"path": None},
             write_config={"path": "l.yaml"}),
        "scene_casadi": (bc.scene_casadi, {"scene": pendulum, "overrides": None, "trust": []}),
        "scene_inverse_dynamics": (bc.scene_inverse_dynamics, one_motor),
        "Linkage": (Linkage, {"scene": four_bar, "robot": four_bar.robot, "actuated": ["crank"]}),
        "Linkage.leading": (linkage.leading, {"name": "unfold"}),
        "scene_derivatives": (bc.scene_derivatives, {
            "scene": pendulum, "q": [0.1], "v": [0.2], "time": 0.0, "torque": [0.3],
            "overrides": None, "trust": []}),
        "linearise": (bc.linearise, {
            "scene": pendulum, "at": "start", "inputs": ["swing"], "keep_symmetries": True,
            "overrides": None, "trust": []}),
        **of(linear, to_control={}, mode_rows={}, plot={"path": None}),
        **of(linear, to_mat={"path": "modes.mat"}),
        **of(linear.modes[0], as_dict={}),
        "root_loci": (bc.root_loci, {
            "scene": pendulum, "parameter": "initial.swing", "values": [0.1], "at": "equilibrium",
            "overrides": None, "trust": [], "progress": lambda done, of: None}),
        **of(loci, plot={"path": "loci.png"}),
        "floquet": (bc.floquet, {"scene": hanging, "period": 0.1, "at": 0.0, "overrides": None, "trust": []}),
        "mobility": (bc.mobility, {"scene": four_bar, "overrides": None, "trust": []}),
        "plot": (bc.plot, {"run": run, "path": None, "frame": "P1"}),
        "replay": (bc.replay, {"source": motion, "path": "page.html", "robot": robot, "over": motion, "trace": ["tip"],
                               "detail": "reduced", "title": None, "plots": False, "live": None, "trust": []}),
        "show": (bc.show, {"source": motion, "robot": robot, "trace": ["tip"], "detail": "reduced", "title": None,
                           "plots": False, "trust": []}),
        "report": (bc.report, {"source": swept, "path": "report.html", "over": None, "trace": ["P1"],
                               "detail": "reduced", "title": None, "live": None, "trust": [], "measures": ["end.time"],
                               "limits": []}),
        "wait_for_optimised_code": (bc.wait_for_optimised_code, {"seconds": 600.0}),
        "check_urdf": (bc.check_urdf, {"path": "planar_2r", "trust": ["."]}),
        **of(robot, carrier={"link": "link_1"}, configuration_rate={"q": q, "v": v},
             compiled={"key": "own", "build": casadi_square, "seldom": False, "inputs": (1,)},
             casadi={"name": "frame", "frame": "tip", "parameters": ["link.link_1.mass"]},
             derivative_code={"algorithm": "inverse_dynamics"}, dynamics={"algorithm": "inverse_dynamics"},
             energy={"q": q, "v": v},
             forward_dynamics={"q": q, "v": v, "tau": a}, forward_dynamics_derivatives={"q": q, "v": v, "tau": a},
             inverse_dynamics_derivatives=states,
             inverse_dynamics_parameter_derivatives={**states, "parameters": ["link.link_1.mass"]},
             frame_pose={"name": "tip", "q": q},
             frame_velocity={"name": "tip", "q": q, "v": v}, frame_acceleration={"name": "tip", **states},
             frame_index={"name": "tip"},
             friction_torque={"v": v}, gravity_torque={"q": q},
             inertia_diagonal={"q": q},
             inverse_dynamics=states, joint={"name": "elbow"}, joint_axis={"name": "elbow"}, joint_reactions=states,
             link_gravity_torques={"q": q}, link_torques=states, mass_matrix={"q": q}, mimics={},
             moved_by={"joints": ["elbow"], "set_masses": {1: 2.0}}, one_degree_joint={"name": "elbow", "what": "own"},
             posture={"values": {"elbow": 1.0}}, supporting_joints={"frame": "tip"},
             trace_frames={"names": ["tip"]},
             with_payloads={"payloads": [payload]}),
        **of(motion, at={"t": [0.1, 0.2], "side": "after"}),
        "judge": (bc.judge, {"robot": robot, "motions": [motion], "actuators": {"shoulder": actuator},
                             "mass_tolerance": 0.1, "conditions": {"voltage": 48.0}, "payloads": [payload],
                             "allow_massless": [], "overrides": None, "trust": []}),
        "verify_selection": (bc.verify_selection, {"scene": "manutec_axis", "motions": ["turn"], "settle": 0.1,
                                                   "frame": "load", "limits": {"tool_error": 1.0}, "sample_time": 1e-3,
                                                   "overrides": None, "trust": [], "progress": print}),
        **of(verdicts, of={"axis": "shoulder"}),
        **of(actuator, available_torque={"speed": v}, curve_use={"torque": v, "speed": a},
             limit_uses={"torque": v, "speed": a}, under={"conditions": bc.Conditions(safety_factor=1.5)},
             electrical_power={"shaft_power": v}, shaft_torque={"load_torque": q, "velocity": v, "acceleration": a}),
        "Actuator.continuous_torque": (chosen.continuous_torque, {"speed": 1.0}),
        "Actuator.of": (bc.Actuator.of, {"motor": motor, "gear": gear, "conditions": bc.Conditions()}),
        "Actuator.supply_power": (chosen.supply_power, {"torque": v, "speed": a}),
        "Motor": (bc.Motor, {field.name: getattr(motor, field.name) for field in fields(motor)}),
        "Gear": (bc.Gear, {field.name: getattr(gear, field.name) for field in fields(gear)}),
        "Conditions": (bc.Conditions, {
            one.name: {} if one.name == "sources" else one.default for one in fields(bc.Conditions)}),
        "Mount": (bc.Mount, {"link": "link_1", "axis": (0.0, 0.0, 1.0), "included_mass": 1.0,
                             "included_axial_inertia": 0.1, "included_transverse_inertia": 0.1}),
        "CoupledTransmission": (bc.CoupledTransmission, {
            "joints": ("elbow",), "motors": ("elbow_motor",), "matrix": ((2.0,),)}),
        "load_catalogue": (lambda folders, shipped, contradicting: bc.load_catalogue(
            folders, shipped=shipped, contradicting=contradicting),
            {"folders": "rows", "shipped": False, "contradicting": True}),
        "write_catalogue": (bc.write_catalogue, {"motors": [motor], "gears": [gear], "folder": "rows"}),
        "select": (bc.select, {
            "robot": "geared_pendulum", "motions": None, "catalogue": small, "objective": "mass",
            "conditions": bc.Conditions(), "duty": None, "keep": None, "exclude": (), "makers": (),
            "transmissions": None, "mounts": None, "feedback": True, "candidates": 2, "effort": 10, "payloads": (),
            "allow_massless": (), "simulated_limits": {"settling_time": 100.0},
            "overrides": {"payloads": []}, "trust": ()}),
        "select_designs": (bc.select_designs, chosen_designs),
        **of(designs,
             write_config={"path": "best_design.yaml"}),
        **of(shipped, filtered={"makers": ["maxon"], "kinds": (), "voltage": None, "exclude": ()},
             gear={"name": "apex_af042_50"}, motor={"name": "maxon_607930"}, only={"ids": ["maxon_607930"]},
             product={"name": "maxon_607930"}),
        **of(bc.Conditions(voltage=48.0), completed={"row": motor}, filled={"row": motor}, only={"names": ["voltage"]},
             updated={"given": {"ambient": 30.0}, "source": "given"}),
        **of(belt, motor_speeds={"joint_speeds": [1.0]}, motor_torques={"joint_torques": [1.0]}),
        **of(selection, axis={"name": "shoulder"}, plot={"path": None, "what": None},
             stated={"candidate": selection.axes[0].chosen},
             write_config={"path": "c.yaml"}),
        **of(sized, sensitivities={"names": ["crank_length"]}),
        **of(sized.sensitivities(["crank_length"])[0], joint={"name": "crank"}),
        **of(sizing, joint={"name": "elbow"}, plot={"path": None, "what": "time", "motion": "waypoints"}),
        **of(four_bar, motion={"name": "unfold"}, physics_key={}, replaced_friction={},
             signals_at={"times": np.array([0.1, 0.2])},
             with_constraint={"function": lambda s: s.q[0], "name": "own", "unit": "rad"},
             with_overrides={"overrides": {"simulate.rtol": 1e-6}}),
        **of(closed_run, constraint={"name": "apex"}, constraint_rank={"row": 1}),
        **of(run, constraint_residual={}, energy_drift={}, equation_residual={}, error_estimate={},
             frame={"name": "P1"}, joint={"name": "swing"}, output={"name": "energy"},
             plot={"path": None, "frame": "P1"}, part={"rows": slice(0, 1)}, parts={},
             remember_estimate={"value": 1e-9, "known_until": 2.0}, remember_origin={"file": "r.npz"},
             remember_sensitivities={"known": run.computed_sensitivities}, sensitivity={"name": "initial.swing"},
             save={"path": "r.npz"},
             to_csv={"path": "r.csv", "progress": None}, velocity_residual={}),
        **of(sticking, stuck={"joint": "swing"}, at_stop={"joint": "swing"}, impacts={"joint": "swing"}),
        **of(locking, event={"name": "lock", "occurrence": 0}, output={"name": "energy"}, per={"unit": "m"}),
        **of(swept, column={"measure": "end.time"}, grid={"measure": "end.time"},
             plot={"path": None, "measures": ["end.time"]}, table={"measures": ["end.time"]},
             to_parquet={"path": "w.parquet"}, to_npz={"path": "w.npz"}),
        **of(found, indices={"measure": "end.time"}, plot={"path": None, "measures": ["end.time"]},
             table={"measures": ["end.time"]}),
        **of(found.statistics, distribution={"measure": "end.time", "levels": (0.5,)},
             exceedance={"limit": "end.time > 1 s"}, table={"measures": ["end.time"]},
             plot={"path": None, "measures": ["end.time"], "limits": ["end.time > 1 s"]}),
        **of(linkage, along={"motion": "unfold", "independent": ["crank"]},
             constraint_wrenches={"t": t, "q": tree[0], "v": tree[1], "multipliers": multipliers},
             force_maps={"t": t, "q": tree[0]}, friction={"t": t, "q": tree[0], "v": tree[1]},
             inertia={"t": t, "q": tree[0]}, torque_map={"t": t, "q": tree[0]}, link_torques=closed_states,
             motion={"motion": "unfold"}, reactions=closed_states, residuals=closed_states, torques=closed_states),
        **of(inverse, constraint_residual={}, equation_residual={}, motor={"name": "swing"}),
    }  # fmt: skip
    results = (
        run, locking, sizing, sized.sensitivities(["crank_length"])[0], verdicts, followed, selection, swept, found,
        found.statistics, best, front, designs, linkages, linear, loci, periodic, fast, factor,
        bc.repeated_cycle("geared_pendulum", "lift_and_return"), bc.mobility(four_bar),
    )  # fmt: skip
    for result in results:
        for name, arguments in RESULT_METHODS.items():
            made.setdefault(f"{type(result).__name__}.{name}", (getattr(result, name), arguments))
    return made


def public() -> dict[str, Any]:
    """Every public callable by its qualified name."""
    found: dict[str, Any] = {"Linkage": Linkage}
    classes = [SceneInverseDynamics, Linkage]
    for name in NAMES:
        thing = public_name(name)
        if inspect.isclass(thing) and name not in (*ERRORS, "Result"):
            classes.append(thing)
            if name not in MADE_BY:
                found[name] = thing
        elif inspect.isfunction(thing):
            found[name] = thing
    for kind in classes:
        for name in dir(kind):
            static = inspect.getattr_static(kind, name)
            if not name.startswith("_") and isinstance(static, type(lambda: 0) | classmethod | staticmethod):
                found[f"{kind.__name__}.{name}"] = getattr(kind, name)
    return found


def finite(value: Any) -> bool:
    """Whether no number of a result is NaN; infinite ones are limits."""
    if isinstance(value, (float, np.ndarray)):
        return not np.isnan(np.asarray(value, dtype=float)).any() if np.asarray(value).dtype.kind == "f" else True
    if isinstance(value, bc.Motion):
        return all(map(finite, (value.time, value.position, value.velocity, value.acceleration)))
    if isinstance(value, bc.results.Trajectory):
        return finite(value.state)
    return all(map(finite, value)) if isinstance(value, (tuple, list)) else True


def attempt(name: str, argument: str, odd: str) -> str | None:
    """What is wrong with the answer to an odd argument; None where nothing is."""
    function, arguments = examples()[name]
    try:
        result = function(**{**arguments, argument: ODD[odd]()})
    except BellcrankError as error:
        text = str(error)
        if "\n" in text or not text.isprintable() or len(text) > 2000:
            return f"not one short sentence: {text[:300]!r}"
        words = (argument, *WORDS.get(argument, ()))
        return None if any(re.search(rf"\b{re.escape(word)}", text) for word in words) else f"unnamed: {text[:300]}"
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-2:]
        return f"{type(error).__name__} at {[f'{Path(f.filename).name}:{f.lineno}' for f in place]}: {str(error)[:200]}"
    finally:
        if Path("x").is_dir():
            shutil.rmtree("x")
        Path("x").unlink(missing_ok=True)  # what was written under that name is no scene
    return None if finite(result) or odd in ("nan", "inf", "nan list") else "NaN in the result"


def draw_nothing(_: Any, target: Any, *__: Any, **___: Any) -> None:
    """An empty picture, in place of a figure's own."""
    if hasattr(target, "write"):
        target.write("<svg></svg>" if isinstance(target, io.StringIO) else b"<svg></svg>")
    else:
        Path(target).write_text("<svg></svg>", encoding="utf-8")


@pytest.fixture(scope="module", autouse=True)
def _folder(tmp_path_factory: pytest.TempPathFactory) -> Any:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("arguments"))
        patch.setattr("webbrowser.open", lambda _: True)
        for drawing in ("matplotlib.figure.Figure.savefig", "bellcrank.present.plot_style._save_png"):
            patch.setattr(drawing, draw_nothing)  # it takes seconds
        yield


def test_every_public_function_has_an_example() -> None:
    known = public()
    assert set(examples()) == set(known)
    for name, (function, arguments) in examples().items():
        if name not in ("join", "show", "load_catalogue"):
            assert set(arguments) == set(inspect.signature(function).parameters), name


# Three values of each argument, of a different type each, are the first tier's; every function takes them turn by turn.
FIRST = (("awkward", "inf", "nothing"), ("mapping", "cube", "-1"), ("None", "nan", "text"))


def test_wrong_arguments_of_each_type_are_refused_by_name() -> None:
    wrong = {}
    for k, name in enumerate(sorted(examples())):
        for argument in examples()[name][1]:
            for odd in FIRST[k % len(FIRST)]:
                if problem := attempt(name, argument, odd):
                    wrong[name, argument, odd] = problem
    assert not wrong


@pytest.mark.tier2
def test_all_wrong_arguments_are_refused_by_name() -> None:
    wrong = {}
    for name, (function, arguments) in examples().items():
        function(**arguments)
        for argument in arguments:
            for odd in ODD:
                if problem := attempt(name, argument, odd):
                    wrong[name, argument, odd] = problem
    assert not wrong


STATES = {
    "inverse_dynamics": ("q", "v", "a"), "forward_dynamics": ("q", "v", "tau"), "mass_matrix": ("q",),
    "gravity_torque": ("q",), "friction_torque": ("v",), "energy": ("q", "v"), "configuration_rate": ("q", "v"),
    "joint_reactions": ("q", "v", "a"), "link_torques": ("q", "v", "a"), "link_gravity_torques": ("q",),
}  # fmt: skip


@pytest.mark.parametrize("target", ["native", "avx2", "baseline"])
def test_nan_and_inf_in_any_entry_of_a_state_are_refused_by_name_for_one_sample_and_a_batch(
    target: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("BELLCRANK_TARGET", target)
    robot = bc.load_robot("planar_2r")  # its torques do not depend on the first angle, where NaN came out as zero
    random = np.random.default_rng(11)
    functions = {name: (getattr(robot, name), names) for name, names in STATES.items()}
    functions["frame_pose"] = (partial(robot.frame_pose, "tip"), ("q",))
    functions["frame_velocity"] = (partial(robot.frame_velocity, "tip"), ("q", "v"))
    functions["frame_acceleration"] = (partial(robot.frame_acceleration, "tip"), ("q", "v", "a"))
    for function, names in functions.values():
        for shape in ((2,), (9, 2)):
            good = {name: random.normal(size=shape) for name in names}
            function(**good)
            for name in names:
                for bad in (math.nan, math.inf, -math.inf):
                    for entry in range(2):
                        spoiled = good[name].copy()
                        spoiled[..., entry].flat[-1] = bad
                        if shape == (2,):
                            spoiled[entry] = bad
                        with pytest.raises(InputError, match=f"argument '{name}': expected finite"):
                            function(**{**good, name: spoiled})


def test_states_too_fast_for_numbers_are_refused_and_never_nan() -> None:
    robot = bc.load_robot("planar_2r")
    far, still = np.full(2, 1e200), np.zeros(2)
    for call in (
        lambda: robot.inverse_dynamics([0.0, 1.0], far, still),
        lambda: robot.forward_dynamics([0.0, 1.0], far, still),
        lambda: robot.energy([0.0, 1.0], far),
        lambda: robot.link_torques([0.0, 1.0], far, still),
        lambda: robot.joint_reactions([0.0, 1.0], far, still),
    ):
        with pytest.raises(InputError, match=r"overflows|no finite answer"):
            call()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: bc.Payload(1.0, "tip", inertia=(1e110, 0, 1e110, 0, 0, 1e110)), "'inertia': .* at most 1e.100"),
        (lambda: bc.Payload(1e308, "tip"), "'mass': .* at most 1e.100"),
        (lambda: bc.Payload(1.0, "tip", cg=(1e200, 0, 0)), "'cg'"),
        (lambda: bc.Actuator(1e200, 1.0, 2.0, 300.0, 400.0), "'ratio': .* at most 1e.100"),
        (lambda: bc.Actuator(1e60, 1.0, 2.0, 300.0, 400.0, rotor_inertia=1e-4), "ratio: .*reflected inertia"),
        (lambda: bc.load_robot("planar_2r", friction={"elbow": (1e300, 0.0)}), "friction"),
        (lambda: bc.load_robot("planar_2r", rotor_inertia={"elbow": 1e300}), "rotor_inertia"),
        (lambda: bc.load_robot("planar_2r", gravity=(0, 0, -1e308)), "gravity"),
        (lambda: bc.load_robot("planar_2r", frames={"far": ("link_1", (1e308, 0, 0), (0, 0, 0))}), "frames"),
    ],
)
def test_numbers_whose_products_would_overflow_are_refused_by_name(make: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()


def test_the_largest_payload_and_ratio_give_finite_torques() -> None:
    payload = bc.Payload(1e100, "tip", inertia=(1e100, 0, 1e100, 0, 0, 1e100))
    robot = bc.load_robot("planar_2r", payloads=[payload])
    torque = robot.inverse_dynamics([0.0, 0.0], [0.0, 0.0], [1.0, 0.0])
    assert np.isfinite(torque).all() and torque[0] > 1e100
    actuator = bc.Actuator(1e49, 1.0, 2.0, 300.0, 400.0, rotor_inertia=1.0)
    assert actuator.reflected_inertia == pytest.approx(1e98)


def test_a_prepared_simulation_made_of_something_else_is_refused():
    for given, words in (((1, {}), "argument 'scene': expected a scene"), ((bc.load_scene("pendulum"), 3), "'given'")):
        with pytest.raises(bc.InputError, match=words):
            bc.results.PreparedSimulation(*given)
