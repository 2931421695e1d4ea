"""What the properties of a machine share: computed once for its class, and so once for its file."""

from functools import partial

import numpy as np
import pytest
from loads import TABLE, table_torque, write_loaded_scene
from machine import Machine, laden_options, random_states, wandering
from plain_dynamics import PlainDynamics
from plain_loads import PlainLoads
from plain_pinocchio import PlainRobot
from products import machine_catalogue
from sized import SIZED

import bellcrank as bc


@pytest.fixture(scope="class")
def machine(request) -> Machine:
    return request.cls.machine


@pytest.fixture(scope="class")
def robot(machine):
    return machine.load_robot()


@pytest.fixture(scope="class")
def states(robot):
    """Positions, velocities and accelerations of 20 random states."""
    return random_states(robot, 20)


@pytest.fixture(scope="class")
def plain(machine, robot):
    """The same tree by plain Pinocchio."""
    return PlainRobot(robot, robot.source, floating_base=machine.floating_base)


@pytest.fixture(scope="class")
def laden(machine, robot):
    """The robot with rotors, friction, payloads, an added frame and gravity askew."""
    return machine.load_robot(**laden_options(robot))


@pytest.fixture(scope="class")
def plain_laden(machine, robot, laden):
    """The same by plain Pinocchio, friction apart."""
    own = {"friction", "friction_width", "clean"}
    options = {key: value for key, value in laden_options(robot).items() if key not in own}
    return PlainRobot(laden, robot.source, floating_base=machine.floating_base, **options)


@pytest.fixture(scope="class")
def scene(machine):
    return machine.load_scene()


@pytest.fixture(scope="class")
def run(machine, scene):
    return bc.simulate(scene, machine.duration)


@pytest.fixture(scope="class")
def loaded_file(machine, tmp_path_factory):
    """The file of the machine's scene with every kind of force."""
    return write_loaded_scene(machine.load_scene().data, machine.loads, tmp_path_factory.mktemp("loaded"))


@pytest.fixture(scope="class")
def loaded(loaded_file):
    return bc.load_scene(loaded_file)


@pytest.fixture(scope="class")
def loaded_run(loaded):
    return bc.simulate(loaded)


@pytest.fixture(scope="class")
def level(loaded_run):
    """A level that the hook crosses where it is fastest, between two rows of the run, m."""
    hook = loaded_run.frame("hook")
    k = int(np.argmax(np.abs(hook.velocity[10:50, 0]))) + 10
    return float(hook.position[k : k + 2, 0].mean())


@pytest.fixture(scope="class")
def plain_scene(machine, loaded):
    """The equations of the same scene by plain Pinocchio."""
    most = next(iter(machine.loads.joints.values()), 0.0)
    return PlainDynamics(loaded, {"table.csv": partial(table_torque, most)})


@pytest.fixture(scope="class")
def plain_rows(plain_scene, loaded_run):
    """What plain Pinocchio makes of the rows of the run."""
    return plain_scene.rows(loaded_run)


@pytest.fixture(scope="class")
def scipy_motion(plain_scene, loaded_run):
    """(q, v, W) of the scene as a function of time by SciPy, which begins anew at the kinks of the table."""
    end = loaded_run.time[-1]
    kinks = [t for t in TABLE[1:, 0].tolist() if t < end]
    return plain_scene.solution(loaded_run.position[0], loaded_run.velocity[0], [0.0, *kinks, end])


@pytest.fixture(scope="class")
def sized_scene(machine):
    return bc.load_scene(machine.sized_name, SIZED[machine.sized_name])


@pytest.fixture(scope="class")
def sized(sized_scene):
    """The sizing of its motors over both motions."""
    return bc.size(sized_scene)


@pytest.fixture(scope="class")
def catalogue(sized):
    """Motors and gears of no maker for the machine."""
    return machine_catalogue(sized)


@pytest.fixture(scope="class")
def plain_loads(sized_scene, sized):
    """The same motors' loads by plain Pinocchio."""
    return PlainLoads(sized_scene, [joint.name for joint in sized.joints])


@pytest.fixture(scope="class")
def driven(loaded):
    """Inverse dynamics of the loaded scene: its first motion, or one through seeded postures for a tree."""
    motion = next(iter(loaded.data.get("motions", ())), None)
    if not loaded.data.get("constraints"):
        motion = wandering(loaded.robot)
    return bc.scene_inverse_dynamics(loaded, motion)
