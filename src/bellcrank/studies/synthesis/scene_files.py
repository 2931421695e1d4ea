"""The files of a linkage: a URDF of its links, and a scene in which the crank turns."""

from __future__ import annotations

from typing import Any

import numpy as np

from bellcrank.studies.synthesis.linkage import FourBar, SixBar, SliderCrank

SECONDS = 4


def file_texts(linkage: FourBar | SliderCrank, function: bool, name: str, urdf: str, remark: str) -> tuple[str, str]:
    """The texts of the URDF and of the scene: the crank turns once and the coupler passes the points, or the crank
    turns through the range of a function, whose input and output are the positions of joints. `urdf` is the name of the
    former's file.
    """
    import yaml

    first, last = float(linkage.angles[0]), float(linkage.angles[-1])
    begin = first - linkage.input_offset
    stop = last - linkage.input_offset if function else begin + (2.0 * np.pi if last >= first else -2.0 * np.pi)
    end, tip = linkage.postures(np.array([first]))
    coupler = float(np.angle((tip - end)[0])) - linkage.ground_angle - first
    output = float(linkage.output(np.array([first]))[0])
    frames: dict[str, Any] = {"coupler_end": {"link": "coupler_link", "xyz": [linkage.coupler, 0.0, 0.0]}}
    parameters = {
        "crank_length": {"value": linkage.crank, "sets": ["joint.coupler.origin.x"]},
        "coupler_length": {"value": linkage.coupler, "sets": ["frame.coupler_end.origin.x"]},
    }
    if isinstance(linkage, FourBar):
        joint, pin = "rocker", "rocker_end"
        frames[pin] = {"link": "rocker_link", "xyz": [linkage.rocker, 0.0, 0.0]}
        parameters["rocker_length"] = {"value": linkage.rocker, "sets": ["frame.rocker_end.origin.x"]}
        parameters["ground_length"] = {"value": linkage.ground, "sets": ["joint.rocker.origin.x"]}
    else:
        joint, pin = "slider", "slider_pin"
        frames[pin] = {"link": "slider_link", "xyz": [0.0, 0.0, 0.0]}
        parameters["offset"] = {"value": linkage.offset, "sets": ["joint.slider.origin.y"]}
    pins = [{"name": "pin", "kind": "point", "frame_a": "coupler_end", "frame_b": pin}]
    guesses: dict[str, Any] = {}
    carrier = "coupler_link"
    if isinstance(linkage, SixBar):
        carrier = "link_link"
        frames["link_end"] = {"link": "link_link", "xyz": [linkage.link, 0.0, 0.0]}
        frames["second_rocker_end"] = {"link": "second_rocker_link", "xyz": [linkage.second_rocker, 0.0, 0.0]}
        parameters["link_length"] = {"value": linkage.link, "sets": ["frame.link_end.origin.x"]}
        second = {"value": linkage.second_rocker, "sets": ["frame.second_rocker_end.origin.x"]}
        parameters["second_rocker_length"] = second
        pins.append({"name": "second_pin", "kind": "point", "frame_a": "link_end", "frame_b": "second_rocker_end"})
        start, corner, pivot = (place[0] for place in linkage.dyad(np.array([first])))
        base = (tip[0] - linkage.rocker_pivot) if linkage.on_rocker else np.exp(1j * linkage.ground_angle)
        turned = {"link": (corner - start) / (tip - end)[0], "second_rocker": (corner - pivot) / base}
        guesses = {name: {"guess": float(np.angle(value))} for name, value in turned.items()}
    outputs: dict[str, Any] = {"output": {"joint": joint, "what": "position"}}
    if not function:
        outputs = {"point": {"frame": "coupler_point", "what": "position"}}
        turn = {"rpy": [0.0, 0.0, linkage.turn]} if linkage.turn else {}
        frames["coupler_point"] = {"link": carrier, "xyz": [*linkage.point, 0.0]} | turn
    data = {
        "name": name,
        "urdf": urdf,
        "gravity": [0, 0, 0],
        "frames": frames,
        "constraints": [
            *pins,
            {"name": "drive", "kind": "prescribed_motion", "joint": "crank", "motion": "turn"},
        ],
        "actuated": ["crank"],
        "motions": {
            "turn": {"kind": "waypoints", "times": [0, SECONDS], "positions": [{"crank": begin}, {"crank": stop}]}
        },
        "initial": {
            "crank": begin,
            "coupler": {"guess": float(np.angle(np.exp(1j * coupler)))},
            joint: {"guess": output},
        }
        | guesses,
        "parameters": parameters,
        "outputs": outputs,
        "simulate": {"duration": SECONDS, "rtol": 1e-9, "atol": 1e-9},
    }
    head = f"# {remark}\n# The bars of the URDF have 1 kg/m, an assumption that acts on torques only."
    body = yaml.safe_dump(data, sort_keys=False, width=120)
    return _urdf(linkage, name), f"{head}\n{body}"


def _urdf(linkage: FourBar | SliderCrank, name: str) -> str:
    bars = [("crank", linkage.crank), ("coupler", linkage.coupler)]
    if isinstance(linkage, FourBar):
        bars.append(("rocker", linkage.rocker))
        if isinstance(linkage, SixBar):
            bars += [("link", linkage.link), ("second_rocker", linkage.second_rocker)]
        thick, output, kind = 0.04 * linkage.ground, "rocker", "continuous"
        place, output_angle = (linkage.ground, 0.0), linkage.output_offset
    else:
        thick, output, kind = 0.04 * linkage.coupler, "slider", "prismatic"
        place, output_angle = (linkage.output_offset, linkage.offset), 0.0
    arms: dict[str, tuple[tuple[float, float], ...]] = {"coupler": (linkage.point,)}
    if isinstance(linkage, SixBar):
        arms = {"coupler": (linkage.joint,), "link": (linkage.point,)}
        arms |= {"rocker": (linkage.second_pivot,)} if linkage.on_rocker else {}
    links = ['  <link name="base"/>', '  <link name="ground"/>']
    for link, length in bars:
        inertia = length**3 / 12.0
        boxes = [(0.0, 0.0, length, 0.0)] + [(0.0, 0.0, *arm) for arm in arms.get(link, ()) if any(arm)]
        visuals = "".join(_bar(*box, thick) for box in boxes)
        links.append(
            f'  <link name="{link}_link">\n    <inertial><origin xyz="{0.5 * length!r} 0 0"/><mass value="{length!r}"/>'
            f'<inertia ixx="{1e-4 * inertia!r}" ixy="0" ixz="0" iyy="{inertia!r}" iyz="0" izz="{inertia!r}"/>'
            "</inertial>\n"
            f"{visuals}  </link>"
        )
    if isinstance(linkage, SliderCrank):
        links.append(_block(linkage, thick))
    joints = [
        ("mount", "fixed", "base", "ground", linkage.pivot, linkage.ground_angle),
        ("crank", "continuous", "ground", "crank_link", (0.0, 0.0), linkage.input_offset),
        ("coupler", "continuous", "crank_link", "coupler_link", (linkage.crank, 0.0), 0.0),
        (output, kind, "ground", f"{output}_link", place, output_angle),
    ]
    if isinstance(linkage, SixBar):
        carrier = "rocker_link" if linkage.on_rocker else "ground"
        joints.append(("link", "continuous", "coupler_link", "link_link", linkage.joint, 0.0))
        joints.append(("second_rocker", "continuous", carrier, "second_rocker_link", linkage.second_pivot, 0.0))
    for joint, kind, parent, child, (x, y), angle in joints:
        axis = "" if kind == "fixed" else f'<axis xyz="{"1 0 0" if kind == "prismatic" else "0 0 1"}"/>'
        axis += _travel(linkage) if isinstance(linkage, SliderCrank) and kind == "prismatic" else ""
        links.append(
            f'  <joint name="{joint}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{x!r} {y!r} 0" rpy="0 0 {angle!r}"/>{axis}</joint>'
        )
    return f'<?xml version="1.0"?>\n<robot name="{name}">\n' + "\n".join(links) + "\n</robot>\n"


def _block(linkage: SliderCrank, thick: float) -> str:
    """The link of a slider: a block as heavy as a bar of its length, three times its thickness."""
    length = 3.0 * thick
    inertia = length**3 / 12.0
    return (
        f'  <link name="slider_link">\n    <inertial><origin xyz="0 0 0"/><mass value="{length!r}"/>'
        f'<inertia ixx="{inertia!r}" ixy="0" ixz="0" iyy="{inertia!r}" iyz="0" izz="{inertia!r}"/></inertial>\n'
        f'    <visual><origin xyz="0 0 0" rpy="0 0 0"/><geometry><box size="{length!r} {2.0 * thick!r} {thick!r}"/>'
        "</geometry></visual>\n  </link>"
    )


def _travel(linkage: SliderCrank) -> str:
    """The limits of a slider: all places that a coupler of this length reaches."""
    reach = linkage.crank + linkage.coupler
    low, high = -reach - linkage.output_offset, reach - linkage.output_offset
    return f'<limit lower="{low!r}" upper="{high!r}" effort="1e9" velocity="1e9"/>'


def _bar(x: float, y: float, to_x: float, to_y: float, thick: float) -> str:
    length, angle = float(np.hypot(to_x - x, to_y - y)), float(np.arctan2(to_y - y, to_x - x))
    return (
        f'    <visual><origin xyz="{0.5 * (x + to_x)!r} {0.5 * (y + to_y)!r} 0" rpy="0 0 {angle!r}"/>'
        f'<geometry><box size="{max(length, thick)!r} {thick!r} {0.5 * thick!r}"/></geometry></visual>\n'
    )
