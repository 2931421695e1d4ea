"""Fastest motions of random arms behind gears that lose power, against a dynamic programme over path speeds.

The programme knows neither intervals nor bounds: at each place of a grid it tries every change from one squared path
speed to another, with the shaft torques of the definition at the middle of the cell. It begins with all speeds and goes
on with finer levels around the best motion so far, on finer and finer grids.

PYTHONPATH=tests/support python -m tests.campaigns.fastest_behind_lossy_gears --cases 50 --seed 1
"""

import argparse
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

import bellcrank as bc

SLOWER = 1e-4  # relative: a fastest motion may take longer by so much
ALIKE = 2e-5  # relative: two grids of the programme whose times differ by less are fine enough
GRIDS = (50, 100, 200, 400, 800)
LEVELS = 121  # of the squared path speed, around the motion so far
ROUNDING = 1e-9
LINK = """<link name="{name}"><inertial><origin xyz="0 0 {half}"/><mass value="{mass}"/>
<inertia ixx="{across}" iyy="{across}" izz="{along}" ixy="0" ixz="0" iyz="0"/></inertial></link>
"""
JOINT = """<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="0 0 {at}"/><axis xyz="{axis}"/></joint>
"""
AXES = {2: ("0 1 0", "0 1 0"), 4: ("0 0 1", "0 1 0", "0 1 0", "1 0 0")}


class Case(NamedTuple):
    """An arm without and with its actuators, its path, and the actuators by joint."""

    arm: bc.Robot
    config: bc.RobotConfig
    path: bc.JointPath
    actuators: dict[str, bc.Actuator]


LIMITS = bc.MotionLimits(speed="none", torque="none")


def random_case(random, axes, folder):
    """An arm of 2 or 4 axes with random links, gears of an efficiency in [0.5, 1], rotors whose inertia matters, motors
    that hold the arm anywhere, and a path of three postures.
    """
    length, mass = random.uniform(0.2, 0.6, axes), random.uniform(1.0, 6.0, axes)
    text = '<robot name="arm"><link name="l0"/>'
    for k in range(axes):
        across = mass[k] * length[k] ** 2 / 12.0
        at = length[k - 1] if k else 0.0
        text += LINK.format(name=f"l{k + 1}", half=length[k] / 2, mass=mass[k], across=across, along=across / 10.0)
        text += JOINT.format(name=f"j{k}", parent=f"l{k}", child=f"l{k + 1}", at=at, axis=AXES[axes][k])
    (folder / "arm.urdf").write_text(text + "</robot>")
    entries = "urdf: arm.urdf\nfriction: none\ngravity: [0, 0, -9.81]\nactuators:\n"
    actuators = {}
    for k in range(axes):
        reach = length[k:].sum()
        held, inertia = 9.81 * mass[k:].sum() * reach, mass[k:].sum() * reach**2
        ratio, efficiency = random.uniform(30.0, 160.0), random.uniform(0.5, 1.0)
        peak = random.uniform(1.3, 3.0) * held / (ratio * efficiency)
        rotor = random.uniform(0.05, 1.0) * inertia / ratio**2
        top = random.uniform(3.0, 12.0) * ratio
        figures = {"ratio": ratio, "efficiency": efficiency, "rotor_inertia": rotor, "peak_torque": peak,
                   "rated_torque": peak / 2.0, "rated_speed": 0.7 * top, "max_speed": top}  # fmt: skip
        entries += f"  j{k}: {{" + ", ".join(f"{key}: {float(value)!r}" for key, value in figures.items()) + "}\n"
        actuators[f"j{k}"] = bc.Actuator(**figures)
    (folder / "arm.yaml").write_text(entries)
    config = bc.load_robot_config(folder / "arm.yaml")
    arm = bc.load_robot(folder / "arm.urdf", friction="none", gravity=(0.0, 0.0, -9.81))
    corners = np.cumsum(random.uniform(-1.2, 1.2, (3, axes)), axis=0)
    path = bc.joint_path(arm, [{f"j{k}": float(q) for k, q in enumerate(row)} for row in corners])
    return Case(arm, config, path, actuators)


class Programme:
    """The time of the best motion over levels of the squared path speed, on grids of a path."""

    def __init__(self, case):
        self.case = case
        self.curves = {name: np.array(one.curve_points).T for name, one in case.actuators.items()}

    def _cells(self, count):
        """First and second derivatives, and torques of u, x and neither, at the middles of cells."""
        arm, path = self.case.arm, self.case.path
        edges = np.linspace(0.0, path.length, count + 1)
        q, first, second = path.at((edges[1:] + edges[:-1]) / 2.0)
        still = np.zeros_like(first)
        held = arm.inverse_dynamics(q, still, still)
        by_u = arm.inverse_dynamics(q, still, first) - held
        by_x = arm.inverse_dynamics(q, first, second) - held
        return first, second, by_u, by_x, held

    def _allowed(self, cell, x, u):
        """Whether accelerations u at squared speeds x keep the limits of all motors."""
        found = np.ones(np.broadcast_shapes(x.shape, u.shape), dtype=bool)
        speed = np.sqrt(x)
        for k, (name, one) in enumerate(self.case.actuators.items()):
            first, second, by_u, by_x, held = (each[k] for each in cell)
            load, turning = by_u * u + by_x * x + held, one.ratio * first * speed
            through = np.where(load * turning >= 0.0, 1.0 / (one.ratio * one.efficiency), one.efficiency / one.ratio)
            shaft = load * through + one.rotor_inertia * one.ratio * (first * u + second * x)
            points = self.curves[name]
            limit = np.interp(np.abs(turning), points[0], points[1]) / one.safety_factor
            found &= (np.abs(shaft) <= limit * (1.0 + ROUNDING)) & (np.abs(turning) <= points[0][-1] * (1.0 + ROUNDING))
        return found

    def best(self, x):
        """The least time and the squared speeds (n + 1,) of its motion among levels x (n + 1, levels), from and to rest."""
        cells = list(zip(*self._cells(len(x) - 1), strict=True))
        step = self.case.path.length / len(cells)
        left = np.where(np.arange(x.shape[1]) == 0, 0.0, np.inf)
        choices = []
        for cell, begin, end in zip(reversed(cells), x[-2::-1], x[:0:-1], strict=True):
            begin, end = begin[:, None], end[None, :]
            with np.errstate(divide="ignore"):
                time = 2.0 * step / (np.sqrt(begin) + np.sqrt(end))
            time = np.where(self._allowed(cell, (begin + end) / 2.0, (end - begin) / (2.0 * step)), time, np.inf) + left
            choices.append(np.argmin(time, axis=1))
            left = np.min(time, axis=1)
        level, found = 0, [0.0]
        for choice, row in zip(reversed(choices), x[1:], strict=True):
            level = choice[level]
            found.append(row[level])
        return left[0], np.array(found)

    def time(self, largest, grids=GRIDS):
        """The least time of path speeds up to a largest one on the finest grid that was needed, and its difference from
        the one before, relative.
        """
        x = np.linspace(0.0, largest, 700) ** 2 + np.zeros((grids[0] + 1, 1))
        x[0] = x[-1] = 0.0
        before, motion = self.best(x)
        if not np.isfinite(before):
            return np.inf, np.inf
        for count in grids:
            motion = np.interp(np.linspace(0.0, 1.0, count + 1), np.linspace(0.0, 1.0, len(motion)), motion)
            width, time = 0.15, np.inf
            while width > 3e-4 and width < 1.0:
                top = motion.max()
                x = np.maximum(0.0, motion[:, None] + np.linspace(-width, width, LEVELS) * top)
                x[:, LEVELS // 2] = motion
                x[0] = x[-1] = 0.0
                now, better = self.best(np.sort(x, axis=1))
                if not np.isfinite(now):
                    width *= 1.7
                    continue
                moved = np.abs(better - motion).max() / top
                time, motion = min(now, time), better
                width = width if moved > 0.7 * width else 0.4 * width
            change = abs(time / before - 1.0)
            if change < ALIKE and count > grids[0]:
                break
            before = time
        return time, change


def compared(seed, axes, grids=GRIDS):
    """The fastest motion of a random arm, and time and change of the programme; None where the motors cannot hold it."""
    with tempfile.TemporaryDirectory() as folder:
        case = random_case(np.random.default_rng([seed, axes]), axes, Path(folder))
        try:
            found = bc.time_optimal(case.config, case.path, LIMITS, costs=False)
        except bc.BellcrankError:
            return None
    return found, *Programme(case).time(1.5 * float(found.speed.max()), grids)


def main():
    """Compare many arms, of 2 and 4 axes in turn."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=50, help="arms")
    parser.add_argument("--seed", type=int, default=1, help="of the first arm")
    given = parser.parse_args()
    gaps, slower, number = [], [], given.seed
    while len(gaps) < given.cases:
        outcome = compared(number, 2 if number % 2 else 4)
        number += 1
        if outcome is None:
            continue
        found, time, change = outcome
        gaps.append(found.gap)
        slower.append(found.duration / time - 1.0)
        print(
            f"{number - 1}: {found.duration:.6f} s, gap {found.gap:.1e}, excess {found.excess:.1e}, programme "
            f"{time:.6f} s (changed by {change:.1e}), slower by {slower[-1]:+.1e}", flush=True,
        )  # fmt: skip
        assert found.lower_bound <= found.duration
    print(f"median gap {np.median(gaps):.1e}, largest {max(gaps):.1e}; slower by at most {max(slower):.1e}")
    assert max(slower) <= SLOWER


if __name__ == "__main__":
    main()
