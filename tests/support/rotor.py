"""A rotor of 2 kg m^2 about z, and a slider of 2 kg along x on the same base, without gravity."""

import json

import bellcrank as bc

INERTIA = 2.0
URDF = """<robot name="rotor"><link name="base"/>
<link name="wheel"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="2" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="sled"><inertial><mass value="2"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="spin" type="continuous"><parent link="base"/><child link="wheel"/><axis xyz="0 0 1"/></joint>
<joint name="slide" type="prismatic"><parent link="base"/><child link="sled"/><axis xyz="1 0 0"/>
<limit lower="-9" upper="9" effort="1e3" velocity="1e3"/></joint></robot>"""


def rotor(folder, files=(), **keys):
    """The scene with these keys, whose file and tables are written to a folder."""
    (folder / "rotor.urdf").write_text(URDF)
    for name, text in dict(files).items():
        (folder / name).write_text(text)
    tight = {"duration": 3, "rtol": 1e-11, "atol": 1e-11, "solver": "DOP853"}
    scene = {"urdf": "rotor.urdf", "gravity": [0, 0, 0], "friction": "none", "simulate": tight, **keys}
    (folder / "rotor.yaml").write_text(json.dumps(scene))
    return bc.load_scene(folder / "rotor.yaml")
