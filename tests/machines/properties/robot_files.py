"""The machine's robot in other formats, and faults planted in its file."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest
import robot_formats
from properties.dynamics import close

import bellcrank as bc

TINY = {"mjcf": 0.0, "sdf": 1e-7}  # of links without inertia, which SDFormat would give 1 kg: here 1e-9 kg


class RobotFiles:
    @pytest.fixture(scope="class", params=["mjcf", "sdf", "xacro"])
    def other(self, request, machine, robot, tmp_path_factory):
        """The format, and the robot in it."""
        folder = tmp_path_factory.mktemp(request.param)
        root = robot_formats.read_parts(robot.source)
        rotors = {name: 0.04 + 0.03 * k for k, name in enumerate(robot.joint_names)}
        if request.param == "mjcf":
            path = folder / "robot.xml"
            path.write_text(robot_formats.mjcf(root, rotors))
            rotors = {}  # which the file has
        elif request.param == "sdf":
            path = folder / "robot.sdf"
            path.write_text(robot_formats.sdf(root, attached=not machine.floating_base))
        else:
            path = folder / "robot.urdf.xacro"
            path.write_text(robot_formats.xacro(robot.source))
        base = machine.floating_base
        return request.param, bc.load_robot(path, floating_base=base, rotor_inertia=rotors, clean=False)

    def test_other_formats_describe_the_same_machine(self, robot, plain, other):
        kind, found = other
        spread = spread_of(robot, found)
        followers = {mimic.follower for mimic in robot.mimics()}  # free joints of formats that have no mimics
        assert set(robot.joint_names) <= set(found.joint_names) <= set(robot.joint_names) | followers
        random = np.random.default_rng(11)
        for _ in range(3):
            q, v, a = random_state(robot, random)
            position = coordinates(robot, found, q)
            own = found.inverse_dynamics(position, spread @ v, spread @ a) - found.friction_torque(spread @ v)
            expected = plain.inverse_dynamics(q, v, a)
            for k, name in enumerate(robot.joint_names):
                expected[robot.joint(name).v] += (0.04 + 0.03 * k) * a[robot.joint(name).v]
            size = np.abs(expected).max()
            assert np.abs(spread.T @ own - expected).max() <= (1e-10 + TINY.get(kind, 0.0)) * size
            last = robot.massive_links[-1]
            place = plain.frame(last, q)
            for value, key in zip(found.frame_pose(last, position), ("position", "rotation"), strict=True):
                close(value, place[key], 1e-10)

    def test_limits_and_friction_are_those_of_the_urdf(self, robot, other):
        kind, found = other
        limits = {str(j.get("name")): j for j in ElementTree.parse(robot.source).getroot().findall("joint")}
        for name in robot.joint_names:
            if name in {mimic.leader for mimic in robot.mimics()}:
                continue  # its range and friction are those of both
            element, mine = limits[name], found.joint(name)
            limit, dynamics = element.find("limit"), element.find("dynamics")
            if element.get("type") == "continuous":
                assert (found.lower[mine.q], found.upper[mine.q]) == (-np.inf, np.inf)
            else:
                for value, key in ((found.lower, "lower"), (found.upper, "upper")):
                    assert value[mine.q] == pytest.approx(float(limit.get(key)), rel=1e-14)
            if kind != "mjcf" and limit is not None:  # which has no speeds, and efforts of motors
                assert found.effort_limit[mine.v] == float(limit.get("effort"))
                assert found.velocity_limit[mine.v] == float(limit.get("velocity"))
            for value, key in ((found.viscous, "damping"), (found.coulomb, "friction")):
                expected = 0.0 if dynamics is None else float(dynamics.get(key, 0.0))
                assert value[mine.v] == pytest.approx(expected, rel=1e-14)

    def test_check_finds_faults_that_are_planted_in_the_file(self, robot, tmp_path):
        """Each with what it is about, the number that is wrong, and the remedy; the file by itself has no error."""
        text = without_shapes(robot.source)
        path = tmp_path / "robot.urdf"
        path.write_text(text)
        sound = {str(finding) for finding in bc.check_urdf(path)}
        assert all(finding.severity != "error" for finding in bc.check_urdf(path))
        link = robot.massive_links[0]
        own = re.search(rf'<link name="{link}">.*?</link>', text, re.S)[0]
        plants = [
            (f"link '{link}'", "error", swapped(own, "ixx", "-0.5"), r"not positive.*check the signs"),
            (f"link '{link}'", "error", swapped(own, "izz", "50.0"), r"triangle inequality.*no rigid body"),
            (f"link '{link}'", "warning", gyrating(own), r"radius of gyration of.*kg m² and about the centre"),
        ]
        changes = [(where, severity, text.replace(own, new), words) for where, severity, new, words in plants]
        moving = [j.name for j in robot.joints if j.kind in ("revolute", "prismatic")]
        if moving:
            name = moving[0]
            joint = re.search(rf'<joint name="{name}".*?</joint>', text, re.S)[0]
            stretched = re.sub(r"<axis[^>]*/>", '<axis xyz="0 0 0.7"/>', joint)
            where = f"joint '{name}'"
            if "<limit" in joint:
                endless = re.sub(r"<limit[^>]*/>", "", joint).replace("revolute", "continuous")
                changes.append((where, "warning", endless, r"has no effort and no velocity limit"))
            changes += [
                (where, "warning", stretched, r"length 0\.7, not 1"),
                (where, "warning", tilted(joint), r"the pitch 1\.57 is -0\.000796 rad off 90°; write 1\.5707963"),
            ]
            changes = [
                (*each[:2], text.replace(joint, each[2]), each[3]) if each[0] == where else each for each in changes
            ]
        for where, severity, changed, words in changes:
            assert changed != text
            path.write_text(changed)
            found = [f for f in bc.check_urdf(path) if str(f) not in sound]
            hits = [f for f in found if f.where == where and re.search(words, f.message)]
            assert hits and hits[0].severity == severity, (where, words, found)

    def test_a_file_that_cannot_be_read_is_named_with_line_and_remedy(self, robot, tmp_path):
        text = without_shapes(robot.source)
        link, path = robot.massive_links[0], tmp_path / "robot.urdf"
        line = next(k for k, row in enumerate(text.splitlines(), 1) if f'<link name="{link}"' in row)
        own = re.search(rf'<link name="{link}">.*?</link>', text, re.S)[0]
        path.write_text(text.replace(own, re.sub(r'<mass value="[^"]*"', '<mass value="heavy"', own)))
        with pytest.raises(bc.InputError, match="'heavy'") as error:
            bc.load_robot(path)
        numbers = [int(x) for x in re.findall(r"line (\d+)", str(error.value))]
        assert str(path) in str(error.value) and link in str(error.value)
        assert numbers and line <= numbers[0] <= line + own.count("\n") + 1
        (finding,) = [f for f in bc.check_urdf(path) if f.severity == "error"]
        assert "'heavy'" in finding.message and str(numbers[0]) in finding.message


# ---- parts


def random_state(robot, random):
    q, (v, a) = random.uniform(-1.2, 1.2, robot.nq), random.normal(size=(2, robot.nv))
    for joint in robot.joints:
        if joint.kind == "floating":
            q[joint.q + 3 : joint.q + 7] /= np.linalg.norm(q[joint.q + 3 : joint.q + 7])
    return q, v, a


def spread_of(robot, other):
    """The velocities of another robot's joints by those of a robot; joints that mimic are free in the other one."""
    found = np.zeros((other.nv, robot.nv))
    for joint, own in paired(robot, other):
        found[joint.v : joint.v + joint.nv, own.v : own.v + own.nv] = np.eye(own.nv)
    for mimic in robot.mimics():
        if mimic.follower in other.joint_names:
            found[other.joint(mimic.follower).v, robot.joint(mimic.leader).v] = mimic.multiplier
    return found


def paired(robot, other):
    """Joints of both; floating ones, which SDFormat does not name, by their kind."""
    names, floating = {j.name: j for j in other.joints}, [j for j in other.joints if j.kind == "floating"]
    return [(names[own.name] if own.name in names else floating[0], own) for own in robot.joints]


def coordinates(robot, other, q):
    found = other.neutral.copy()
    for joint, own in paired(robot, other):
        found[joint.q : joint.q + joint.nq] = q[own.q : own.q + own.nq]
    for mimic in robot.mimics():
        if mimic.follower in other.joint_names:
            found[other.joint(mimic.follower).q] = mimic.multiplier * q[robot.joint(mimic.leader).q] + mimic.offset
    return found


def without_shapes(source):
    """The text of a URDF without shapes, whose files may be missing, one attribute form for all."""
    tree = ElementTree.parse(source)
    for link in tree.getroot().findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    return ElementTree.tostring(tree.getroot(), encoding="unicode").replace(" />", "/>")


def swapped(link, key, value):
    return re.sub(rf'{key}="[^"]*"', f'{key}="{value}"', link)


def gyrating(link):
    """A link of a few grams with an inertia of kilograms and metres."""
    found = re.sub(r'<mass value="[^"]*"', '<mass value="0.003"', link)
    for key in ("ixx", "iyy", "izz"):
        found = swapped(found, key, "0.31")
    for key in ("ixy", "ixz", "iyz"):
        found = swapped(found, key, "0")
    return found


def tilted(joint):
    """A joint whose origin has a right angle with three digits."""
    turned = '<origin xyz="0 0 0.1" rpy="0 1.57 0"/>'
    return re.sub(r"<origin[^>]*/>", turned, joint) if "<origin" in joint else joint.replace("<axis", f"{turned}<axis")
