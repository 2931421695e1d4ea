"""Hostile inputs of the other files that bellcrank reads: SDFormat, xacro, loops, catalogues, selections, tool paths,
axes of sweeps, study folders, scenes for CasADi, and public functions called by their signatures.

Right files are damaged as in fuzz_inputs.py; Case is the same.
"""

from __future__ import annotations

import json
import random
from typing import Any

import yaml
from fuzz_case import Case, yaml_bytes
from fuzz_damage import Damage
from fuzz_seeds import LOOP, SCENE

SDF = """<sdf version="1.6"><model name="two"><link name="base"/>
<link name="upper"><pose>0.1 0 1 0 0 0.5</pose><inertial><pose>0.3 0 0 0 0 0</pose><mass>2</mass>
<inertia><ixx>0.01</ixx><ixy>0</ixy><ixz>0</ixz><iyy>0.06</iyy><iyz>0</iyz><izz>0.06</izz></inertia></inertial></link>
<link name="lower"><pose>0.6 0 1 0 0 0.5</pose><inertial><mass>1.5</mass>
<inertia><ixx>0.02</ixx><iyy>0.03</iyy><izz>0.03</izz></inertia></inertial></link>
<joint name="shoulder" type="revolute"><parent>base</parent><child>upper</child><axis><xyz>0 1 0</xyz>
<limit><lower>-3</lower><upper>3</upper><effort>40</effort><velocity>5</velocity></limit>
<dynamics><damping>0.1</damping><friction>0.2</friction></dynamics></axis></joint>
<joint name="elbow" type="prismatic"><parent>upper</parent><child>lower</child><axis><xyz>1 0 0.1</xyz></axis></joint>
<joint name="end" type="revolute"><pose>0.4 0 0 0 0 0</pose><parent>base</parent><child>lower</child>
<axis><xyz>0 0 1</xyz></axis></joint></model></sdf>
"""
XACRO = """<robot name="two" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="mass" default="2"/><xacro:property name="m" value="$(arg mass)"/>
<xacro:property name="sizes" value="${dict(upper=0.3, lower=0.2)}"/>
<xacro:macro name="body" params="name mass:=^|1 *place">
<link name="${name}"><inertial><xacro:insert_block name="place"/>
<mass value="${mass}"/><inertia ixx="${mass/100}" ixy="0" ixz="0" iyy="${0.1*mass}" iyz="0" izz="${0.1*mass}"/>
</inertial></link></xacro:macro>
<xacro:include filename="part.xacro"/>
<xacro:body name="upper" mass="${m}"><origin xyz="${sizes['upper']} 0 0"/></xacro:body>
<xacro:if value="${sizes['lower'] > 0.1}"><xacro:body name="lower"><origin xyz="0.2 0 0.05"/></xacro:body></xacro:if>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="${-pi}" upper="${radians(90)}" effort="40" velocity="5"/></joint>
<joint name="elbow" type="prismatic"><parent link="upper"/><child link="lower"/><origin xyz="0.6 0 0"/>
<axis xyz="1 0 0.1"/><limit lower="-0.5" upper="0.5" effort="90" velocity="1"/></joint></robot>
"""
PART = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="base"/></robot>'
EXPRESSIONS = [
    "x" * 40, "1/0", "[1, 2][9]", "open('/etc/passwd').read()", "().__class__.__bases__", "'x'.rjust(10**9)",
    "2**10**7", "load_yaml('part.xacro')", "range(10**9)", "sum([[]], [])", "m.__class__", "None", "lambda: 1", "pi",
    "nan", "'a' * m", "[x for x in range(9)]", "sizes.upper", "xacro.arg('mass')", "$(arg mass)", "'%s' % m", "1e400",
    "int('9'*9999)",
]  # fmt: skip
LOOP_FILES = {
    "loop.xml": (
        '<mujoco><worldbody><body name="ground">\n<body name="crank_link"><joint name="crank" axis="0 0 1"/>'
        '<inertial pos="1.2 0 0" mass="20" diaginertia="1 1 1"/>\n<body name="coupler_link" pos="1.241 0 0">'
        '<joint name="coupler" axis="0 0 1"/><inertial pos="0.6 0 0" mass="8" diaginertia="1 1 1"/></body></body>\n'
        '<body name="rocker_link" pos="1.241 0 0"><joint name="rocker" axis="0 0 1"/>'
        '<inertial pos="0.6 0 0" mass="8" diaginertia="1 1 1"/></body></body></worldbody>\n<equality>'
        '<connect name="apex" body1="coupler_link" body2="rocker_link" anchor="1.2 0 0"/></equality></mujoco>'
    ),
    "loop.sdf": (
        '<sdf version="1.6"><model name="four_bar"><link name="ground"/><link name="crank_link"/>\n'
        '<link name="coupler_link"><pose>1.241 0 0 0 0 0</pose></link>\n'
        '<link name="rocker_link"><pose>1.241 0 0 0 0 0</pose></link>\n'
        '<joint name="crank" type="revolute"><parent>ground</parent><child>crank_link</child>'
        "<axis><xyz>0 0 1</xyz></axis></joint>\n"
        '<joint name="coupler" type="revolute"><parent>crank_link</parent><child>coupler_link</child>'
        "<axis><xyz>0 0 1</xyz></axis></joint>\n"
        '<joint name="rocker" type="revolute"><parent>ground</parent><child>rocker_link</child>'
        "<axis><xyz>0 0 1</xyz></axis></joint>\n"
        '<joint name="apex" type="revolute"><pose>1.2 0 0 0 0 0</pose><parent>rocker_link</parent>'
        "<child>coupler_link</child>\n<axis><xyz>0 0 1</xyz></axis></joint></model></sdf>"
    ),
    "loop.yaml": "closed_loop: [[a, b]]\ntype: ['3d']\nname_mot: [crank]\n",
}
KIND_OF = {"loop.xml": "mjcf", "loop.sdf": "sdf", "loop.yaml": "gepetto"}
MOTORS = """id,maker,model,kind,nominal_voltage [V],resistance [Ω],torque_constant [N m/A],torque_constant_basis,\
no_load_speed [rpm],nominal_torque [N m],nominal_speed [rpm],nominal_current [A],peak_torque [N m],max_speed [rpm],\
rotor_inertia [kg m^2],viscous_friction [N m s/rad],max_winding_temperature [°C],resistance_winding_housing [K/W],\
resistance_housing_ambient [K/W],time_constant_winding [s],time_constant_motor [s],mass [kg],quality,source,notes
small,Acme,S1,motor,48,0.6,0.1,dc,4500,0.5,3500,5.5,1.6,6000,4e-5,1e-5,150,0.8,2,20,900,0.8,datasheet,sheet 1,
large,Acme,L1,servo,48,0.2,0.2,dc,2300,2.4,1800,13,8,3000,3e-4,2e-5,150,0.4,1.2,30,1500,2.2,datasheet,sheet 2,"a, b"
"""
GEARS = """id,maker,model,kind,ratio,inertia [kg m^2],inertia_side,rated_torque [N m],rated_speed [rpm],\
repeated_peak_torque [N m],momentary_torque [N m],average_speed [rpm],efficiency [%],\
stiffness [N m/rad],mass [kg],source
g50,Acme,G50,strain_wave,50,8e-6,input,40,2000,80,150,3500,75,13000,0.7,sheet 3
g100,Acme,G100,strain_wave,100,8e-6,input,90,2000,180,300,3500,70,20000,1.1,sheet 3
"""
SELECTION: dict[str, Any] = {
    "urdf": "planar_2r",
    "gravity": [0, -9.81, 0],
    "payloads": [{"mass": 0.5, "frame": "tip"}],
    "conditions": {"voltage": 48, "ambient": 25, "safety_factor": 1.2, "inertia_ratio": 200},
    "actuators": {"elbow": {"motor": "small", "gear": "g50"}},
    "catalogue": ".",
    "duty": [{"motion": "swing", "repeat": 2}, {"pause": "1 s"}],
    "motions": {
        "swing": {
            "kind": "waypoints",
            "times": [0, 2, 4],
            "positions": [{"elbow": "-30 deg"}, {"elbow": "-90 deg"}, {"elbow": "-30 deg"}],
        }
    },
}
MOVES: dict[str, Any] = {
    "urdf": "planar_2r",
    "motions": {
        "across": {
            "kind": "point_to_point",
            "positions": [{}, {"elbow": 1}, {"shoulder": 1, "elbow": 1}],
            "speed": {"shoulder": "90 deg/s", "elbow": 2},
            "acceleration": 5,
            "jerk": 100,
            "blend": 0.2,
            "samples": 101,
        },
        "around": {
            "kind": "tool_path",
            "frame": "tip",
            "start": {"shoulder": "10 deg", "elbow": "60 deg"},
            "begin": [1.2, 0.3, 0],
            "points": [
                [1.2, 0.8, 0],
                {"to": [0.8, 0.8, 0], "blend": "50 mm"},
                {"via": [0.6, 1, 0], "to": [0.8, "1200 mm", 0]},
            ],
            "blend": "100 mm",
            "speed": 0.5,
            "acceleration": 4,
            "jerk": 60,
            "coordinates": ["x", "y"],
            "samples": 101,
        },
    },
}
STUDIES = [
    {"initial.shoulder": [0.1, 0.2, "30 deg"], "parameters.k": "10:50:3"},
    {"parameters.k": "normal(40, 2)"},
    {"parameters.k": "uniform(30, 50)", "initial.elbow": [0.3]},
    {"parameters.k": "loguniform(30, 50)", "simulate.rtol": [1e-5, 1e-6]},
    {"parameters.k": "truncnormal(40, 2, 35, 45)", "initial.shoulder": "triangular(10 deg, 20 deg, 30 deg)"},
]


def _sdf(d: Damage) -> Case:
    text = d.text(SDF) if d.rng.random() < 0.6 else d.attributes(SDF)
    data = text.encode("utf-8", "replace")
    return Case({"robot.sdf": d.bytes(data) if d.rng.random() < 0.1 else data}, "robot", ("robot.sdf", {}))


def _xacro(d: Damage) -> Case:
    files = {"robot.xacro": XACRO, "part.xacro": PART}
    name = d.rng.choice(["robot.xacro"] * 5 + ["part.xacro"])
    text = files[name]
    if name == "robot.xacro" and d.rng.random() < 0.5:
        parts = text.split("${")
        k = d.rng.randrange(1, len(parts))
        parts[k] = d.rng.choice([*EXPRESSIONS, str(d.number())]) + parts[k][parts[k].index("}") :]
        text = "${".join(parts)
    else:
        text = d.attributes(text) if d.rng.random() < 0.7 else d.text(text)
    data = {key: each.encode() for key, each in files.items()} | {name: text.encode("utf-8", "replace")}
    return Case(data, "robot", ("robot.xacro", {}))


def _loops(d: Damage) -> Case:
    name = d.rng.choice(list(LOOP_FILES))
    text = LOOP_FILES[name]
    damaged = d.attributes(text) if name != "loop.yaml" and d.rng.random() < 0.7 else d.text(text)
    scene = json.loads(json.dumps(LOOP))
    scene["constraints"] = [{"name": "apex", "kind": KIND_OF[name], "file": name}]
    data = damaged.encode("utf-8", "replace")
    return Case({name: data, "scene.yaml": yaml.safe_dump(scene).encode()}, "scene", ("scene.yaml",))


def _catalogue(d: Damage) -> Case:
    files = {"motors.csv": MOTORS, "gears.csv": GEARS}
    for name in d.rng.sample(list(files), d.rng.choice([1, 1, 2])):
        files[name] = _table(d, files[name])
    data = {name: text.encode("utf-8", "replace") for name, text in files.items()}
    if d.rng.random() < 0.1:
        data["motors.csv"] = d.bytes(data["motors.csv"])
    return Case(data, "catalogue", (".",))


def _table(d: Damage, text: str) -> str:
    """A table with another number, word or header in some cells, or rows and columns left out or doubled."""
    rows = [line.split(",") for line in text.splitlines()]
    for _ in range(d.rng.choice([1, 1, 2, 4])):
        row = d.rng.choice(rows)
        k = d.rng.randrange(len(row)) if row else 0
        what = d.rng.randrange(8)
        if row and what < 4:
            row[k] = str(d.value(3))
        elif what == 4:
            header = d.rng.choice(rows[0])
            rows[0][k % len(rows[0])] = d.rng.choice([header, header.replace("[", "[k"), header + " [m]", ""])
        elif what == 5:
            for each in rows:
                del each[k : k + 1]
        elif what == 6:
            rows.append(list(row))
        elif row:
            row.pop(k)
    return "\n".join(",".join(row) for row in rows) + "\n"


def _selection(d: Damage) -> Case:
    files = {"motors.csv": MOTORS, "gears.csv": GEARS}
    if d.rng.random() < 0.3:
        name = d.rng.choice(list(files))
        files[name] = _table(d, files[name])
    data = {name: text.encode("utf-8", "replace") for name, text in files.items()}
    data["arm.yaml"] = yaml_bytes(d, SELECTION) if d.rng.random() < 0.8 else yaml.safe_dump(SELECTION).encode()
    return Case(data, "select", ("arm.yaml", d.rng.choice(["mass", "cost", "loss", "margin"]), d.rng.random() < 0.3))


def _tool_path(d: Damage) -> Case:
    moves = json.loads(json.dumps(MOVES))
    del moves["motions"][d.rng.choice(["around", "across", "across"])]
    return Case({"moves.yaml": yaml_bytes(d, moves)}, "moves", ("moves.yaml",))


def _axes(d: Damage) -> Case:
    study = {"vary": d.rng.choice(STUDIES), "sample": 4, "seed": 1}
    study = d.data(study, gentle=0.4) if d.rng.random() < 0.8 else study
    axes, more = None, {}
    if d.rng.random() < 0.5:  # given to the function
        axes, more = study.pop("vary", None), study
        study = {}
    scene = SCENE | ({"study": study} if study else {})
    text = yaml.safe_dump(scene, allow_unicode=True, sort_keys=False).encode("utf-8", "replace")
    return Case({"scene.yaml": text}, "sweep", ("scene.yaml", axes, more))


def _study(d: Damage) -> Case:
    return Case({}, "study", (d.rng.randrange(2**32),))  # of a folder that the child makes


def damaged_folder(files: dict[str, bytes], seed: int) -> dict[str, bytes]:
    """A study's folder with a file damaged, cut, emptied or left out, or another's in its place."""
    d = Damage(random.Random(seed))
    files = dict(files)
    for _ in range(d.rng.choice([1, 1, 2])):
        name = d.rng.choice(sorted(files))
        what = d.rng.randrange(6)
        if name.endswith(".json") and what < 3:
            try:
                data = json.loads(files[name])
            except ValueError:
                continue
            files[name] = json.dumps(d.data(data)).encode("utf-8", "replace")
        elif what < 3:
            files[name] = d.bytes(files[name])
        elif what == 3:
            files[name] = files[name][: d.rng.randrange(len(files[name]) + 1)]
        elif what == 4:
            files[name] = files[d.rng.choice(sorted(files))]
        elif len(files) > 1:
            del files[name]
    return files


def _casadi(d: Damage) -> Case:
    scene = d.rng.choice([SCENE, LOOP])
    return Case({"scene.yaml": yaml_bytes(d, scene)}, "casadi", ("scene.yaml",))


def _call(d: Damage) -> Case:
    return Case({}, "call", (d.rng.randrange(2**32),))


KINDS = {
    "sdf": _sdf, "xacro": _xacro, "loops": _loops, "catalogue": _catalogue, "selection": _selection,
    "tool_path": _tool_path, "axes": _axes, "study": _study, "casadi": _casadi, "call": _call,
}  # fmt: skip
