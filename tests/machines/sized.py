"""What is sized of each machine: its configuration with two short motions, friction, forces and actuators.

Motions are polynomials of few rows, so that a sizing is quick and peaks lie between rows. No two joints have the same
figures, and numbers differ from 0 and 1.
"""

from typing import Any

Changes = dict[str, Any]

_MOTOR = {
    "nominal_voltage": 48.0, "torque_constant": 0.071, "torque_constant_basis": "phase_rms", "resistance": 0.34,
    "coulomb_friction": 0.013, "viscous_friction": 4e-5, "rotor_inertia": 4.4e-5, "nominal_torque": 0.95,
    "nominal_speed": 310.0, "peak_torque": 2.9, "peak_current": 51.0, "peak_time": 1.3, "max_speed": 640.0,
    "resistance_winding_housing": 0.53, "resistance_housing_ambient": 1.9, "time_constant_winding": 19.0,
    "time_constant_motor": 1100.0, "max_winding_temperature": 140.0, "max_housing_temperature": 95.0,
    "reference_temperature": 25.0, "mass": 0.82,
}  # fmt: skip
_GEAR = {
    "kind": "strain_wave", "ratio": 120.0, "efficiency": 0.73, "back_efficiency": 0.61, "inertia": 1.7e-5,
    "inertia_side": "input", "rated_torque": 47.0, "repeated_peak_torque": 210.0, "max_speed": 900.0,
    "average_torque": 70.0, "average_speed": 400.0, "mass": 1.1,
}  # fmt: skip


def _reach(times: list[float], *positions: Any, samples: int = 2) -> Changes:
    return {"kind": "waypoints", "times": times, "positions": list(positions), "samples": samples}


def _ratings(ratio: float, rated: float, peak: float, inertia: float, **others: Any) -> Changes:
    """An actuator with torques at the shaft, N m, and an inertia, kg m²."""
    return {
        "ratio": ratio, "rated_torque": rated, "peak_torque": peak, "rated_speed": 290.0, "max_speed": 520.0,
        "rotor_inertia": inertia, "gear_inertia": 0.4 * inertia, "efficiency": 0.77, "safety_factor": 1.15,
        "motor_efficiency": 0.89, **others,
    }  # fmt: skip


PLANAR_2R: Changes = {
    "gravity": [1.3, -9.4, 0.4],
    "friction": {"shoulder": {"viscous": 4.0, "coulomb": 6.0}, "elbow": {"viscous": 2.3, "coulomb": 3.1}},
    "forces": [
        {"name": "coil", "kind": "joint_spring", "joint": "elbow", "stiffness": 21.0, "rest": 0.4, "preload": 3.7},
        {"name": "pull", "kind": "wrench", "frame": "tip", "force": [11.0, -7.0, 3.0], "torque": [0.8, -0.6, 2.1]},
    ],
    "motions": {
        "reach": _reach([0, 1.1, 2.3], [0.3, -0.4], [1.1, 0.5], [0.7, 1.3]),
        "back": _reach([0, 1.6], [1.9, 0.6], [0.2, 1.4]),
    },
    "actuators": {
        "shoulder": _ratings(90.0, 3.6, 9.5, 5e-5),
        "elbow": {"motor": _MOTOR, "gear": _GEAR, "voltage": 44.0, "voltage_reserve": 0.07, "safety_factor": 1.25,
                  "ambient": 33.0, "altitude": 1400.0},
    },
}  # fmt: skip

_UR5 = [f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")]
UR5: Changes = {
    "gravity": [1.3, -0.8, -9.4],
    "friction": {name: {"viscous": 1.3 - 0.2 * k, "coulomb": 0.9 + 0.3 * k} for k, name in enumerate(_UR5)},
    "motions": {
        "reach": _reach(
            [0, 1.0, 2.1], [0.1, -1.2, 1.5, -0.3, 0.5, 0.2], [0.9, -0.6, 0.8, 0.4, -0.5, 1.0],
            [0.4, -0.9, 1.9, -1.0, 0.9, 2.0],
        ),
        "back": _reach([0, 1.4], [0.4, -0.9, 1.9, -1.0, 0.9, 2.0], [-0.3, -1.3, 1.1, -0.2, 0.3, 1.2]),
    },
    "actuators": {
        "shoulder_pan_joint": _ratings(101.0, 0.80, 2.1, 8e-5),
        "shoulder_lift_joint": _ratings(121.0, 1.10, 2.9, 9e-5, efficiency=0.81, motor_efficiency=0.84),
        "elbow_joint": {"motor": _MOTOR, "gear": _GEAR | {"ratio": 100.0}, "safety_factor": 1.05},
        "wrist_1_joint": _ratings(81.0, 0.21, 0.6, 2e-5, curve=[[0, 0.55], [110, 0.5], [330, 0.2]]),
        "wrist_2_joint": _ratings(101.0, 0.17, 0.5, 1.4e-5, efficiency=0.66, safety_factor=1.3),
    },
}  # fmt: skip

_PANDA = [*(f"panda_joint{k}" for k in range(1, 8)), "panda_finger_joint1"]
PANDA: Changes = {
    "gravity": [-0.9, 1.4, -9.3],
    "friction": {name: {"viscous": 0.9 - 0.1 * k, "coulomb": 0.7 + 0.1 * k} for k, name in enumerate(_PANDA)},
    "motions": {
        "reach": _reach(
            [0, 1.0, 2.1], [0.1, -0.2, 0.5, -1.3, 0.5, 1.2, 0.3, 0.01], [0.9, -0.6, 0.8, -2.0, -0.5, 1.0, 0.8, 0.03],
            [0.4, 0.4, -0.3, -1.0, 0.9, 2.0, -0.4, 0.02],
        ),
        "back": _reach(
            [0, 1.5], [0.4, 0.4, -0.3, -1.0, 0.9, 2.0, -0.4, 0.02], [-0.3, 0.3, 0.1, -2.2, 0.3, 1.2, 0.5, 0.035],
        ),
    },
    "actuators": {
        **{
            name: _ratings(100.0 + 7.0 * k, 0.55 - 0.06 * k, 1.3 - 0.14 * k, (6.0 - 0.7 * k) * 1e-5,
                           efficiency=0.79 - 0.02 * k)
            for k, name in enumerate(_PANDA[:6])
        },
        "panda_finger_joint1": _ratings(1570.0, 0.012, 0.02, 3e-7, rated_speed=30.0, max_speed=90.0),  # a screw
    },
}  # fmt: skip

FOUR_BAR: Changes = {
    "gravity": [1.3, -9.4, 0.5],
    "friction": {
        "crank": {"viscous": 0.4, "coulomb": 0.6},
        "coupler": {"viscous": 0.23, "coulomb": 0.35},
        "rocker": {"viscous": 0.31, "coulomb": 0.45},
    },
    "forces": [
        {"name": "spring", "kind": "joint_spring", "joint": "crank", "preload": 1.96, "stiffness": 0.7, "rest": 0.3},
        {"name": "oil", "kind": "friction", "joint": "rocker", "viscous": 0.8, "coulomb": 0.3, "width": 2e-3},
    ],
    "motions": {
        "unfold": _reach([0, 1.1, 2.3], {"crank": 0.3}, {"crank": 1.1}, {"crank": 0.7}, samples=15),
        "fold": _reach([0, 1.6], {"crank": 1.3}, {"crank": 0.4}, samples=11),
    },
    "actuators": {"crank": _ratings(60.0, 6.1, 15.0, 2e-4)},
}  # fmt: skip

DELTA: Changes = {
    "gravity": [1.3, -0.8, -9.4],
    "friction": {f"motor_{k}": {"viscous": 0.1 * k, "coulomb": 0.2 + 0.07 * k} for k in (1, 2, 3)},
    "forces": [
        {"name": "blast", "kind": "wrench", "frame": "tool", "force": [2.0, -3.0, 1.2], "torque": [0.05, 0.08, -0.11]}
    ],
    "motions": {
        "across": {"kind": "line", "frame": "tool", "begin": [-0.1, -0.05, -0.85], "end": [0.12, 0.1, -0.78],
                   "duration": 0.41, "samples": 12},
        "down": {"kind": "line", "frame": "tool", "begin": [0.12, 0.1, -0.78], "end": [0.02, -0.1, -0.85],
                 "duration": 0.33, "samples": 9},
    },
    "actuators": {
        "motor_1": _ratings(20.0, 0.42, 1.1, 4e-5, efficiency=0.94),
        "motor_2": _ratings(25.0, 0.31, 1.6, 3e-5, efficiency=0.91, motor_efficiency=0.83),
        "motor_3": _ratings(16.0, 0.55, 1.2, 5e-5, efficiency=0.88, safety_factor=1.4),
    },
}  # fmt: skip

SIZED: dict[str, Changes] = {
    "planar_2r": PLANAR_2R, "ur5": UR5, "panda": PANDA, "four_bar": FOUR_BAR, "delta": DELTA,
}  # fmt: skip

# How the motors of each machine are chosen: arguments of `bc.select`.
SELECTED: dict[str, Changes] = {
    "planar_2r": {"objective": "mass", "duty": ["reach", {"pause": 0.7}, {"motion": "back", "repeat": 3}, "reach"]},
    "ur5": {
        "objective": "cost", "keep": {"elbow_joint": "m0b+g0"},
        "mounts": {"wrist_1_joint": {"link": "upper_arm_link", "axis": [0.3, 0.5, -0.8], "included_mass": 0.4,
                                     "included_axial_inertia": 1e-4, "included_transverse_inertia": 2e-4}},
    },
    "panda": {"objective": "loss", "duty": [{"motion": "back", "repeat": 2}, {"pause": 1.3}, "reach", {"pause": 0.4}]},
    "four_bar": {"objective": "margin", "mounts": {"crank": {"included_mass": 0.2}}},
    "delta": {"objective": "mass", "duty": ["across", "down", {"pause": 0.2}]},
}  # fmt: skip

# What limits the fastest motions of each machine besides its URDF and actuators: arguments of `bc.MotionLimits`.
FASTEST: dict[str, Changes] = {
    "planar_2r": {"tool": "tip", "tool_speed": 2.6, "tool_acceleration": 9.0},
    "ur5": {"speed": {"wrist_2_joint": 2.4}, "tool": "tool0", "tool_speed": 1.1, "tool_angular_speed": 4.2},
    "panda": {"acceleration": {"panda_joint4": 9.1, "panda_joint1": 6.0}},
    "four_bar": {"acceleration": {"crank": 5.3}},
    "delta": {"tool": "tool", "tool_speed": 1.3, "tool_acceleration": 41.0},
}  # fmt: skip

# What is studied of the sizings of some machines: parameters, the values of a sweep, and steps of differences.
STUDIED: dict[str, Changes] = {
    "planar_2r": {
        "parameters": {"mass": {"value": 48.0, "sets": ["link.link_2.mass"]},
                       "length": {"value": 0.97, "sets": ["joint.elbow.origin.x"]},
                       "stiffness": {"value": 21.0, "sets": ["forces.coil.stiffness"]}},
        "vary": {"mass": [41.0, 55.0], "actuators.shoulder.ratio": [83.0, 97.0]},
        "steps": {"length": 4e-4, "stiffness": 0.02},
    },
    "four_bar": {
        "parameters": None,
        "vary": {"crank_length": [1.236, 1.244]},
        "steps": {"crank_length": 2e-4},
    },
}  # fmt: skip
