"""The fastest motions of random arms whose gears lose power by direction, against a dynamic programme of its own.

Each arm has 2 or 4 revolute joints and motors behind gears with efficiencies of 0.4 to 0.95. The programme knows the
path, the arm's inverse dynamics and the motors' torque over speed, and nothing of the planner: the square x of the path
speed takes levels at the places of a grid, the acceleration between two places is constant, and limits are kept at
both. It searches all speeds first and then corridors about the best ones that narrow (R. Luus, Iterative Dynamic
Programming, 2000). Its time falls with the cells, and is never below that of the fastest motion; how far that is from
the optimum its lower bound says, which holds for all motions, switched ones too.

python -m tests.campaigns.fastest_behind_lossy_gears --cases 50 --seed 1
"""

import argparse
import statistics
import tempfile
from pathlib import Path

import numpy as np
import yaml

import bellcrank as bc

LEVELS = 31
SETTLED = 1e-6  # relative: a narrower corridor changes the time by less
NARROWER = 0.4
CELLS = (100, 200, 400)
KEPT = 1e-6  # share by which a limit is exceeded
FREE = bc.MotionLimits(speed="none", torque="none")


def random_arm(seed, folder):
    """A random arm, its configuration, its actuators by joint, and a path through three postures."""
    rng = np.random.default_rng(seed)
    count = 2 if rng.random() < 0.5 else 4
    urdf = folder / f"arm{seed}.urdf"
    urdf.write_text(_urdf(rng, count))
    gravity = rng.normal(scale=5.0, size=3).tolist()
    robot = bc.load_robot(urdf, friction="none", gravity=gravity)
    postures = rng.uniform(-1.5, 1.5, size=(3, count))
    path = bc.joint_path(robot, postures)
    s = np.linspace(0.0, path.length, 200)
    q, first, second = path.at(s)
    still = np.zeros_like(q)
    holding = np.abs(robot.inverse_dynamics(q, still, still)).max(axis=0)
    moving = np.abs(robot.inverse_dynamics(q, first, first + second)).max(axis=0)
    actuators = {}
    for k, joint in enumerate(robot.joints):
        ratio, efficiency = float(rng.uniform(20.0, 160.0)), float(rng.uniform(0.4, 0.95))
        peak = float((2.5 * holding[k] + 2.0 * moving[k] + 0.1) / (ratio * efficiency))
        rated = float(rng.uniform(150.0, 500.0))
        actuators[joint.name] = {
            "ratio": ratio, "efficiency": efficiency, "peak_torque": peak, "rated_torque": peak / 3.0,
            "rated_speed": rated, "max_speed": 1.6 * rated,
            "rotor_inertia": peak / (ratio * float(rng.uniform(20.0, 400.0))),
        }  # fmt: skip
    config = folder / f"arm{seed}.yaml"
    data = {"urdf": urdf.name, "friction": "none", "gravity": gravity, "actuators": actuators}
    config.write_text(yaml.safe_dump(data))
    return robot, config, actuators, path


def _urdf(rng, count):
    parts = ['<robot name="arm"><link name="l0"/>']
    for k in range(count):
        mass, inertia = float(rng.uniform(0.5, 6.0)), float(rng.uniform(0.005, 0.1))
        xyz = " ".join(f"{x:.4f}" for x in rng.uniform(-0.4, 0.4, size=3))
        axis = "0 0 1" if count == 2 else " ".join(f"{x:.6f}" for x in _unit(rng))
        parts.append(
            f'<link name="l{k + 1}"><inertial><origin xyz="{xyz}"/><mass value="{mass:.5f}"/>'
            f'<inertia ixx="{inertia:.6f}" iyy="{inertia:.6f}" izz="{inertia:.6f}" ixy="0" ixz="0" iyz="0"/></inertial>'
            f'</link><joint name="j{k}" '
            f'type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>'
            '<limit lower="-9" upper="9" effort="1e4" velocity="1e3"/></joint>'
        )
    return "".join(parts) + "</robot>"


def _unit(rng):
    axis = rng.normal(size=3)
    return axis / np.linalg.norm(axis)


class Programme:
    """The dynamic programme of a path on a grid."""

    def __init__(self, robot, actuators, path, cells):
        self.cells, self.step = cells, path.length / cells
        q, self.first, self.second = path.at(np.linspace(0.0, path.length, cells + 1))
        still = np.zeros_like(q)
        self.gravity = robot.inverse_dynamics(q, still, still)
        self.along = robot.inverse_dynamics(q, still, self.first) - self.gravity
        self.bend = robot.inverse_dynamics(q, self.first, self.second) - self.gravity
        names = list(actuators)
        of = lambda name: np.array([actuators[each][name] for each in names])  # noqa: E731
        self.ratio, self.efficiency, self.rotor = of("ratio"), of("efficiency"), of("rotor_inertia")
        self.peak, self.rated, self.top = of("peak_torque"), of("rated_speed"), of("max_speed")

    def allowed(self, place, x, u, ahead):
        """Whether the motors bear an acceleration at a place; where a joint turns, on the side of the cell."""
        first = self.first[place]
        way = np.where(first == 0.0, (1.0 if ahead else -1.0) * self.second[place], first)
        x, u = x[..., None], u[..., None]
        load = self.along[place] * u + self.bend[place] * x + self.gravity[place]
        passed = np.where(load * way >= 0.0, 1.0 / self.efficiency, self.efficiency) * load / self.ratio
        shaft = passed + self.rotor * self.ratio * (first * u + self.second[place] * x)
        speed = np.abs(self.ratio * first) * np.sqrt(x)
        limit = self.peak * np.clip((self.top - speed) / (self.top - self.rated), 0.0, 1.0)
        return np.all((np.abs(shaft) <= limit * (1.0 + 1e-12)) & (speed <= self.top), axis=-1)

    def best(self, levels):
        """The least time over levels (cells + 1, l) of x, infinite where none can be kept, and the levels it takes."""
        cost = np.where(levels[-1] == 0.0, 0.0, np.inf)
        choices = []
        for place in range(self.cells - 1, -1, -1):
            here, there = levels[place][:, None], levels[place + 1][None, :]
            u = (there - here) / (2.0 * self.step)
            fits = self.allowed(place, np.broadcast_to(here, u.shape), u, True)
            fits &= self.allowed(place + 1, np.broadcast_to(there, u.shape), u, False)
            with np.errstate(divide="ignore"):
                time = 2.0 * self.step / (np.sqrt(here) + np.sqrt(there))
            total = np.where(fits, time + cost[None, :], np.inf)
            choices.append(np.argmin(total, axis=1))
            cost = np.min(total, axis=1)
        chosen = [int(np.argmin(np.where(levels[0] == 0.0, cost, np.inf)))]
        for choice in reversed(choices):
            chosen.append(int(choice[chosen[-1]]))
        return float(cost[chosen[0]]), np.array([row[k] for row, k in zip(levels, chosen, strict=True)])

    def time(self, known=None):
        """The least time of corridors that narrow, from all speeds or from those of another grid, and the speeds."""
        with np.errstate(divide="ignore"):
            most = np.min((self.top / self.ratio / np.abs(self.first)) ** 2, axis=1)
        most = np.minimum(most, 1e3 * np.median(most))
        if known is None:
            levels = most[:, None] * np.linspace(0.0, 1.0, 4 * LEVELS) ** 2
            levels[0] = levels[-1] = 0.0
            best, x = self.best(levels)
            half = 0.1 * most
        else:
            best, half = np.inf, 0.02 * most
            x = np.interp(np.linspace(0.0, 1.0, self.cells + 1), np.linspace(0.0, 1.0, len(known)), known)
        offsets = np.linspace(-1.0, 1.0, LEVELS) ** 3  # finest where the best are
        calm = 0
        while calm < 2 and half.max() > 1e-9 * most.max():
            levels = np.clip(x[:, None] + half[:, None] * offsets, 0.0, most[:, None])
            levels[0] = levels[-1] = 0.0
            better, found = self.best(levels)
            if not np.isfinite(better):  # no way through the corridor: a finer one about speeds of a coarser grid
                return (best, x) if np.isfinite(best) else self.time()
            inner = np.abs(found - x)[1:-1] < 0.5 * half[1:-1]
            calm = calm + 1 if best - better < SETTLED * better else 0
            best, x, half = min(best, better), found, NARROWER * half if inner.mean() > 0.8 else half
        return best, x


def compared(seed, folder):
    """Of one arm: the motion, and the times of programmes on finer and finer grids over its time, less 1."""
    robot, config, actuators, path = random_arm(seed, folder)
    found = bc.time_optimal(config, path, FREE, costs=False)
    slower, x = [], None
    for cells in CELLS:
        time, x = Programme(robot, actuators, path, cells).time(x)
        slower.append(time / found.duration - 1.0)
    return found, slower


def main():
    """Run the campaign and print what it found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    gaps, excess, programmes = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(given.cases):
            found, slower = compared(given.seed * 100_000 + number, Path(folder))
            gaps.append(1.0 - found.lower_bound / found.duration)
            excess.append(found.excess)
            programmes.append(min(slower))
            print(number, f"{gaps[-1]:.2g} {excess[-1]:.2g}", *(f"{each:.2g}" for each in slower), flush=True)
    kept = [value <= KEPT for value in excess]
    of_kept = [gap for gap, each in zip(gaps, kept, strict=True) if each]
    print(f"{given.cases} arms: {sum(kept)} motions keep all limits to {KEPT:g}, the others exceed one by up to "
          f"{max(excess):.2g} and say so; gap of the lower bound of those that keep them: median "
          f"{statistics.median(of_kept):.2g}, largest {max(of_kept):.2g}, least {min(of_kept):.2g}; programmes take "
          f"{min(programmes):.2g} to {max(programmes):.2g} longer")  # fmt: skip


if __name__ == "__main__":
    main()
