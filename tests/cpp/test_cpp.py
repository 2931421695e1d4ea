"""The C++ tests of this folder are built and run once; each of their cases is a test here."""

import os
import re
import shutil
import subprocess
from collections import defaultdict
from pathlib import Path
from xml.etree import ElementTree

import pytest

pytestmark = pytest.mark.tier2

HERE = Path(__file__).parent
SOURCES = os.environ.get("BELLCRANK_CPP_SOURCES", HERE.parents[1] / "src" / "cpp")  # set for a changed copy
INSTALL = "apt-get install g++ cmake doctest-dev"
CASES = [
    pytest.param(name, id=f"{path.stem.removeprefix('test_')}: {name}")
    for path in sorted(HERE.glob("test_*.cpp"))
    for name in re.findall(r'^TEST_CASE\("(.*)"\)', path.read_text(), re.MULTILINE)
]


def missing():
    """What of the tools is not here, or None."""
    compiler = shutil.which(os.environ.get("CXX", "c++"))
    if not compiler or not shutil.which("cmake"):
        return "a C++ compiler and cmake"
    header = [compiler, "-x", "c++", "-E", "-include", "doctest/doctest.h", os.devnull]
    found = subprocess.run(header, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
    return "doctest/doctest.h" if found.returncode else None


def run(*command):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if done.returncode:
        pytest.fail(f"{' '.join(map(str, command))} failed:\n{done.stdout}", pytrace=False)


@pytest.fixture(scope="session")
def failures(tmp_path_factory):
    """The failures of each case by its name; a case of several programs (for wider registers) has those of all."""
    if absent := missing():
        reason = f"{absent} not found; install with: {INSTALL}"
        (pytest.fail if os.environ.get("CI") else pytest.skip)(reason)
    build = tmp_path_factory.mktemp("cpp")
    run("cmake", "-S", HERE, "-B", build, f"-DSOURCES={SOURCES}", *(["-G", "Ninja"] if shutil.which("ninja") else []))
    run("cmake", "--build", build, "--parallel", "2")
    found = defaultdict(list)
    for program in [path for path in build.glob("cpp_tests*") if path.is_file()]:
        report = build / f"{program.name}.xml"
        command = [program, "--reporters=junit", f"--out={report}"]
        ended = subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False, timeout=300)  # 1: some failed
        if "ERROR: AddressSanitizer" in ended.stderr:
            pytest.fail(f"{program.name} reads or writes outside an array:\n{ended.stderr}", pytrace=False)
        for case in ElementTree.parse(report).iter("testcase"):
            found[case.get("name")] += [f"{program.name}: {(problem.text or '').strip()}" for problem in case]
    return dict(found)


@pytest.mark.parametrize("name", CASES)
def test_a_case_in_cpp(name, failures):
    assert not failures[name], "\n".join(failures[name][:3])


def test_every_case_of_the_programs_is_a_test_here(failures):
    names = [case.values[0] for case in CASES]
    assert sorted(names) == sorted(failures)
