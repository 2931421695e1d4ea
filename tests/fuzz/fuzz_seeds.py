"""What the fuzz test begins with: right inputs, and numbers, words and expressions that are not."""

from __future__ import annotations

import math
from typing import Any

NUMBERS = [
    0,
    -0.0,
    1,
    -1,
    2,
    7,
    1e-3,
    1e-9,
    1e-17,
    1e-160,
    5e-324,
    1e9,
    1e17,
    1e155,
    1e308,
    -1e308,
    math.inf,
    -math.inf,
    math.nan,
    2**31,
    2**63,
    -(2**63) - 1,
    10**40,
    0.1,
    90,
    1e6,
    400,
]
WORDS = [
    "",
    " ",
    "0x1F",
    "1e999",
    "nan",
    "-inf",
    "1_000",
    "٣",
    "²",
    "1,5",
    "10 deg",
    "3 parsec",
    "1e308 deg",
    "50 %",
    "5 rpm",
    "true",
    "null",
    "../../../etc/passwd",
    "/dev/zero",
    "a/b\\c",
    "new\nline",
    "tab\tbed",
    "\x1b[31mred",
    "nul\x00",
    "=1+1",
    "@x",
    "\u202etfel",
    "日本語",
    "é",
    "x" * 300,
    "y" * 20_000,
    "<b>&amp;",
    "'\"`",
    "{0}%s",
    "!!int ''",
    "2020-99-99",
    "12:34:56",
    "shoulder",
    "elbow",
    "tip",
    "world",
    "time",
]
TERMS = [
    "t",
    "pi",
    "shoulder.position",
    "elbow.velocity",
    "1e308",
    "1e-320",
    "0",
    "2",
    "3.5",
    "frame('tip').x",
    "frame('tip').vy",
]
SHAPES = ["({} + {})", "({} * {})", "({} / {})", "({} ** {})", "({} - {})", "max({}, {})", "atan2({}, {})"]
CALLS = ["sin({})", "log({})", "sqrt({})", "exp({})", "(-{})", "abs({})", "asin({})", "tan({})"]
STRANGE = [
    "nobody.position",
    "t.real",
    "().__class__",
    "'a'",
    "[t]",
    "1j",
    "True",
    "None",
    "π",
    "",
    "{} % {}",
    "{} < {}",
    "{} if {} else 1",
    "{}({})",
    "open({})",
    "(lambda: {})()",
    "(" * 120 + "{}" + ")" * 120,
    "{}" + " + t" * 700,
    "sin" * 900,
    "9" * 3000,
    "{} **",
    "{}\n{}",
    "{};{}",
]

URDF = """<robot name="two_links">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.3 0 0" rpy="0 0 0"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.06" iyz="0" izz="0.06"/></inertial>%s</link>
  <link name="lower"><inertial><origin xyz="0.2 0 0.05"/><mass value="1.5"/>
    <inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
  <link name="tip"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 1" rpy="0 0 0.5"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="40" velocity="5"/>
    <dynamics damping="0.1" friction="0.2"/></joint>
  <joint name="elbow" type="prismatic"><parent link="upper"/><child link="lower"/><origin xyz="0.6 0 0"/>
    <axis xyz="1 0 0.1"/><limit lower="-0.5" upper="0.5" effort="90" velocity="1"/></joint>
  <joint name="end" type="fixed"><parent link="lower"/><child link="tip"/><origin xyz="0.4 0 0" rpy="0 0.2 0"/></joint>
</robot>
"""
MJCF = """<mujoco model="arm"><compiler angle="degree" eulerseq="xyz" boundmass="0.001" meshdir="." autolimits="true"/>
<include file="defaults.xml"/><option gravity="0 0 -9.81"/>
<asset><mesh name="m" file="a.obj" scale="0.1 0.1 0.1"/></asset>
<worldbody><geom type="plane" size="1 1 1"/>
  <body name="a" pos="0 0 1" euler="0 10 0" childclass="c"><joint name="j" axis="0 1 0" ref="20" range="-90 90"/>
    <joint name="k" type="slide" axis="1 0 0" pos="0 0.1 0" stiffness="10" springref="0.1" frictionloss="0.1"/>
    <geom type="capsule" size="0.05" fromto="0 0 0 0.3 0 0.1"/><site name="s" pos="0.3 0 0"/>
    <frame pos="0 0.1 0" quat="1 0 0 0.2"><body name="b"><joint name="l" type="hinge"/>
      <geom type="mesh" mesh="m" density="500"/><geom type="box" size="0.1 0.02 0.03" mass="0.2"/></body></frame>
  </body>
  <replicate count="2" offset="0 0.2 0" euler="0 0 30"><body name="r" pos="1 0 0">
    <joint name="t" axis="1 0 0" springdamper="0.2 0.5"/>
    <inertial pos="0 0 -0.1" mass="0.5" diaginertia="0.002 0.003 0.004" xyaxes="1 0 0 0 1 0.1"/></body></replicate>
</worldbody>
<equality><connect body1="a" body2="r0" anchor="0.1 0 0"/><weld body1="a" body2="b" active="false"/>
  <joint joint1="l" joint2="j" polycoef="0.1 1 0.2 0 0"/></equality>
<actuator><motor name="m" joint="j" gear="10" ctrlrange="-1 1" armature="0.001"/></actuator>
<keyframe><key name="home" qpos="0.1 0 0.2 0 0"/></keyframe></mujoco>
"""
MJCF_DEFAULTS = """<mujoco><default><default class="c"><joint damping="0.1" armature="0.01"/><geom rgba="1 0 0 1"/>
</default></default></mujoco>
"""
MESHED = """<visual><geometry><mesh filename="%s" scale="0.1 0.1 0.1"/></geometry>
<material name="m"><color rgba="1 0 0 1"/></material></visual>"""
SCENE: dict[str, Any] = {
    "name": "Arm",
    "urdf": "planar_2r",
    "gravity": [0, -9.81, 0],
    "frames": {"hook": {"link": "tip", "xyz": [0, 0.1, 0]}},
    "initial": {"shoulder": "20 deg", "elbow": 0.3, "velocity": {"shoulder": 0.1}},
    "forces": [
        {
            "name": "rope",
            "kind": "spring",
            "frame_a": "hook",
            "frame_b": "world",
            "point": [2, 0, 0],
            "stiffness": 40,
            "free_length": 0.5,
        },
        {"kind": "damper", "joint": "elbow", "coefficient": 0.5},
        {"name": "push", "kind": "wrench", "frame": "tip", "force": [0, 1, 0]},
    ],
    "control": [
        {"name": "hold", "kind": "pd", "joint": "elbow", "kp": 20, "kd": 2, "target": {"elbow": "20 deg"}, "limit": 30}
    ],
    "parameters": {"k": {"value": 40, "sets": ["forces.rope.stiffness"]}},
    "events": [{"name": "level", "when": {"joint": "shoulder", "position": 0}, "direction": "down"}],
    "outputs": {
        "tip": {"frame": "tip", "what": "position"},
        "energy": {"energy": "total"},
        "speed": {"expression": "shoulder.velocity * 2", "unit": "rad/s"},
    },
    "simulate": {"duration": 0.1, "rtol": 1e-6, "atol": 1e-6, "samples": 11, "max_evaluations": 20_000},
}
HELD: dict[str, Any] = {
    **SCENE,
    "joint_stops": "from_file",
    "joints": {
        "shoulder": {"dry_friction": {"coulomb": 4, "static": 6, "speed": 0.05, "law": "hyperbolic", "viscous": 0.5}},
        "elbow": {
            "dry_friction": {"coulomb": "2 N m"},
            "stop": {"lower": 0.2, "upper": "30 deg", "restitution": 0.4, "stop": True},
        },
    },
}
MOTOR = {
    "maker": "a", "model": "b", "torque_constant": 0.1, "torque_constant_basis": "dc", "resistance": 0.5,
    "inductance": "1 mH", "rotor_inertia": 1e-4, "resistance_winding_housing": 2, "resistance_housing_ambient": 6,
    "time_constant_winding": 10, "time_constant_motor": 400,
}  # fmt: skip
DRIVEN: dict[str, Any] = {
    "urdf": "planar_2r",
    "gravity": [0, -9.81, 0],
    "conditions": {"voltage": 48, "bus_capacitance": "2 mF", "bus_max_voltage": 56, "brake_resistance": 5},
    "supply": {"resistance": 0.5},
    "joints": {
        "elbow": {"clutch": {"with": "shoulder", "ratio": -1, "torque": 3, "engaged": "t - 0.01", "delay": 0.01}},
    },
    "actuators": {
        "shoulder": {
            "motor": MOTOR,
            "gear": {"maker": "a", "model": "g", "kind": "planetary", "ratio": 100, "efficiency": 0.8, "inertia": 0,
                     "inertia_side": "input"},
            "model": "dc",
            "elastic": {"stiffness": 1e4, "damping": 10, "backlash": 0.001},
            "rotor_friction": {"coulomb": 0.01, "static": 0.02, "speed": 1, "viscous": 1e-4},
            "temperatures": {"winding": 40, "housing": 30},
            "servo": {"target": 0.1, "position": {"kp": 10}, "speed": {"kp": 0.1, "ti": 0.01},
                      "current": {"kp": 1, "ki": 100}, "sample_time": {"speed": "1 ms"}},
        },
        "elbow": {
            "motor": MOTOR | {"coulomb_friction": 0.01, "viscous_friction": 1e-4},
            "gear": {"maker": "a", "model": "h", "kind": "planetary", "ratio": 50, "efficiency": 1, "inertia": 0,
                     "inertia_side": "input"},
            "model": "dc",
            "elastic": {"stiffness": "rigid", "backlash": "2 mrad", "restitution": 0.3},
            "servo": {"target": 0.2, "state_space": {"inputs": ["error", "rotor_velocity", "-t"], "A": [[0.9]],
                      "B": [[0.1, 0, 0]], "C": [[2]], "D": [[30, -0.1, 0.01]], "sample_time": "1 ms"}},
        },
    },
    "simulate": {"duration": 0.05, "rtol": 1e-6, "atol": 1e-6, "samples": 11, "max_evaluations": 20_000},
}  # fmt: skip
LOOP: dict[str, Any] = {
    "urdf": "four_bar",
    "frames": {"a": {"link": "coupler_link", "xyz": [1.2, 0, 0]}, "b": {"link": "rocker_link", "xyz": [1.2, 0, 0]}},
    "constraints": [
        {
            "name": "apex",
            "kind": "point",
            "frame_a": "a",
            "frame_b": "b",
            "dry_friction": {"coulomb": 0.5, "static": 0.7, "speed": 0.1, "axis": [0, 0, 1]},
        }
    ],
    "forces": [{"kind": "joint_spring", "joint": "crank", "preload": 1.96, "stiffness": 0.1}],
    "initial": {"crank": "1 deg", "coupler": {"guess": "359 deg"}, "rocker": {"guess": "1 deg"}},
    "simulate": {"duration": 0.2, "rtol": 1e-6, "atol": 1e-6, "samples": 11, "max_evaluations": 20_000},
}
CONFIGURATION: dict[str, Any] = {
    "urdf": "planar_2r",
    "gravity": [0, -9.81, 0],
    "payloads": [{"mass": 1.5, "frame": "tip", "cg": [0.05, 0, 0]}],
    "friction": {"shoulder": {"viscous": 0.5, "coulomb": 2}},
    "motions": {
        "swing": {
            "kind": "waypoints",
            "times": [0, 1, 2],
            "positions": [{"elbow": "-30 deg"}, {"elbow": "-90 deg"}, {"elbow": "-30 deg"}],
        },
        "twice": {"kind": "join", "parts": ["swing", {"kind": "dwell", "duration": 0.5}, "swing"]},
    },
}
MOTION = (
    "time [s],shoulder position [deg],elbow position [deg]\n"
    "0.0,60,-40\n0.5,65,-45\n1.0,75,-60\n1.5,80,-75\n2.0,80,-80\n"
)
TORQUE = "time [s],shoulder torque [N m]\n0,1\n0.05,2\n0.2,-1\n"
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nmtllib a.mtl\nusemtl m\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"
STL = (
    "solid a\n"
    + "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n" * 4
    + "endsolid a\n"
)
DAE = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="f" count="9">0 0 0 1 0 0 0 1 0</float_array>
<technique_common><accessor source="#f" count="3" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor>
</technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="1">
<input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
