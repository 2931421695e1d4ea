"""A plain model of Pinocchio with one number of its robot file or scene changed, for differences by that number."""

from __future__ import annotations

from collections.abc import Callable
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from plain_pinocchio import PlainRobot

AXES, TURNS = ("x", "y", "z"), ("roll", "pitch", "yaw")
MOMENTS = {"xx": (0, 0), "xy": (0, 1), "yy": (1, 1), "xz": (0, 2), "yz": (1, 2), "zz": (2, 2)}


def number(plain: PlainRobot, name: str) -> Callable[[float], None]:
    """What changes the model's number "joint.NAME.origin.x", "link.NAME.mass" and so on by as much as it is given."""
    kind, own, what = name.split(".", 1)[0], name.split(".")[1], name.split(".", 2)[2]
    return {"joint": _origin, "link": _body, "frame": _frame}[kind](plain, own, what.removeprefix("origin."))


def _placed(xyz: np.ndarray, rpy: np.ndarray, what: str, shift: float) -> pin.SE3:
    xyz, rpy = xyz.copy(), rpy.copy()
    if what in AXES:
        xyz[AXES.index(what)] += shift
    else:
        rpy[TURNS.index(what)] += shift
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), xyz)


def _origin(plain: PlainRobot, own: str, what: str) -> Callable[[float], None]:
    element = next(e for e in ElementTree.parse(plain.path).getroot().iter("joint") if e.get("name") == own)
    origin, model = element.find("origin"), plain.model
    texts = ("0 0 0",) * 2 if origin is None else tuple(origin.get(key, "0 0 0") for key in ("xyz", "rpy"))
    xyz, rpy = (np.array(text.split(), dtype=float) for text in texts)
    parent = model.frames[model.getFrameId(element.find("parent").get("link"), pin.FrameType.BODY)].placement
    number = model.getJointId(own)

    def change(shift: float) -> None:
        model.jointPlacements[number] = parent * _placed(xyz, rpy, what, shift)

    return change


def _frame(plain: PlainRobot, own: str, what: str) -> Callable[[float], None]:
    link, xyz, rpy = plain.frames[own]
    model = plain.model
    parent = model.frames[model.getFrameId(link, pin.FrameType.BODY)].placement
    xyz, rpy = np.array(xyz, dtype=float), np.array(rpy, dtype=float)
    number = model.getFrameId(own)

    def change(shift: float) -> None:
        model.frames[number].placement = parent * _placed(xyz, rpy, what, shift)

    return change


def _body(plain: PlainRobot, own: str, what: str) -> Callable[[float], None]:
    """The link's body is taken off its joint and a changed one put on."""
    model = plain.model
    name, mass, centre, about = plain.bodies()[own]
    frame = model.frames[model.getFrameId(name, pin.FrameType.BODY)]
    whole = pin.Inertia(model.inertias[frame.parentJoint])
    others = whole.toDynamicParameters() - _parameters(frame.placement, mass, centre, about)

    def change(shift: float) -> None:
        m, c, inertia = mass, centre.copy(), about.copy()
        if what == "scale":
            m, inertia = m * (1.0 + shift), inertia * (1.0 + shift)
        elif what == "mass":
            m += shift
        elif what.startswith("cg."):
            c[AXES.index(what[3:])] += shift
        else:
            i, j = MOMENTS[what.removeprefix("inertia.")]
            inertia[i, j] += shift
            inertia[j, i] = inertia[i, j]
        parameters = others + _parameters(frame.placement, m, c, inertia)
        model.inertias[frame.parentJoint] = pin.Inertia.FromDynamicParameters(parameters)

    return change


def _parameters(placement: pin.SE3, mass: float, centre: np.ndarray, about: np.ndarray) -> np.ndarray:
    """m, m c and the inertia about the joint's origin, in which Newton's and Euler's equations are linear."""
    at, turned = placement.rotation @ centre + placement.translation, placement.rotation @ about @ placement.rotation.T
    inertia = turned + mass * (at @ at * np.eye(3) - np.outer(at, at))
    return np.array([mass, *(mass * at), *(inertia[i, j] for i, j in MOMENTS.values())])
