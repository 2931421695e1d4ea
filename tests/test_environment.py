"""Commands under environments that are not the developer's: locales, variables, memory limits."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.errors import InputError
from bellcrank.files import bundled_data
from bellcrank.memory import check_memory, free_memory
from bellcrank.messages import file_name_here, readable, utf8
from bellcrank.scene.settings import check_rows

COMMANDS = "import sys, bellcrank.cli as c; print([c.main(line.split('|')) for line in sys.argv[1:]])"
NAME = "名前é"


def run(folder, *lines, **variables):
    """Run commands, arguments separated by |, in one process with these variables; (exit codes, stderr)."""
    environment = {**os.environ, **variables}
    done = subprocess.run(
        [sys.executable, "-c", COMMANDS, *lines], cwd=folder, env=environment, capture_output=True, timeout=120
    )
    last = done.stdout.decode("utf-8", "replace").strip().splitlines()[-1]
    return json.loads(last), done.stderr.decode("utf-8", "replace")


def scene_text(name):
    return (
        f"name: {name} ²\nurdf: {name}.urdf\nmotions:\n  {name}: {{kind: waypoints, times: [0, 1], "
        "positions: [{elbow: 0}, {elbow: 30 deg}]}\ninitial: {elbow: 1}\nsimulate: {duration: 0.1, samples: 11}\n"
    )


@pytest.mark.tier2
def test_names_of_other_alphabets_pass_every_command_in_a_locale_without_them(tmp_path):
    folder = tmp_path / "é"
    folder.mkdir()
    shutil.copy(bundled_data.folder("urdf") / "planar_2r.urdf", folder / f"{NAME}.urdf")
    (folder / f"{NAME}.yaml").write_text(scene_text(NAME), encoding="utf-8")
    scene = f"é/{NAME}.yaml"
    codes, said = run(
        tmp_path,
        f"check|é/{NAME}.urdf",
        f"simulate|{scene}|--out|é/run|--no-plots",
        f"report|{scene}|--simulate|--out|é/report.html",
        f"replay|é/run/run.npz|--out|é/{NAME}.html",
        f"plot|{scene}|--simulate|--out|é/{NAME}.png",
        f"size|{scene}|--out|é/{NAME}_sizing|--no-plots",
        f"check|é/{NAME}_not_there.urdf",
        LC_ALL="C", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0",
    )  # fmt: skip
    assert codes[:4] == [0, 0, 0, 0] and codes[4] == 0 and codes[5] == 0 and codes[6] == 2, (codes, said)
    assert said == f"bellcrank: é/{NAME}_not_there.urdf: no such file; give the path of a robot file or the " + (
        "name of a robot, such as planar_2r\n"
    )
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert NAME in page and page.rstrip().endswith("</html>")
    assert (folder / f"{NAME}.html").stat().st_size > 100_000 and (folder / f"{NAME}.png").stat().st_size > 1000
    sizing = json.loads((folder / f"{NAME}_sizing" / "sizing.json").read_text(encoding="utf-8"))
    assert NAME in json.dumps(sizing, ensure_ascii=False)
    assert (folder / f"{NAME}_sizing" / f"history_{NAME}.csv").is_file()
    again = bc.load_run(folder / "run" / "run.npz")  # saved there, read here
    assert again.scene.name == f"{NAME} ²" and len(again) == 11


def test_file_names_of_any_bytes_become_utf_8_texts():
    held = "a" + "".join(chr(0xDC00 + byte) for byte in "é名".encode())
    assert utf8(held) == "aé名".encode() and readable(held) == "aé名"
    assert readable("\udcff\ud800x") == "??x" and readable("plain ²") == "plain ²"
    assert held.encode("ascii", "bellcrank") == "aé名".encode() and "m/s²".encode("ascii", "bellcrank") == b"m/s\\xb2"
    assert file_name_here("é") == "é"


@pytest.mark.tier2
@pytest.mark.parametrize(
    "variables",
    [
        {"MPLBACKEND": "nonsense", "COLUMNS": "0", "LINES": "-1", "TERM": "dumb", "PYTHONWARNINGS": "error"},
        {
            "MPLBACKEND": "module://nowhere", "HOME": "/nonexistent", "COLUMNS": "9" * 30,
            "BELLCRANK_CACHE": "/proc/nowhere", "XDG_CACHE_HOME": "/proc/nowhere",
        },
    ],
)  # fmt: skip
def test_variables_of_the_environment_are_in_nobodys_way(tmp_path, variables):
    codes, said = run(
        tmp_path, "simulate|pendulum|--duration|0.1|--samples|11|--out|run", "plot|run|--out|a.png", **variables
    )
    assert codes == [0, 0], said
    assert "Traceback" not in said and (tmp_path / "a.png").stat().st_size > 1000


@pytest.mark.tier2
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="limits of memory are read from /proc")
def test_samples_that_do_not_fit_are_refused_with_how_many_do_and_so_many_do(tmp_path):
    program = (
        "import re, resource\n"
        "import bellcrank as bc\n"
        "scene = bc.load_scene('pendulum')\n"
        "bc.simulate(scene, samples=11)\n"
        "used = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (used + 200 * 2**20,) * 2)\n"
        "try:\n"
        "    bc.simulate(scene, samples=10**8, duration=0.1)\n"
        "except bc.InputError as error:\n"
        "    said = str(error)\n"
        "most = int(re.search(r'at most (\\d+) fit', said)[1])\n"
        "print(said)\n"
        "most -= most // 100\n"  # the process itself may grow by some 100 kB between the two runs
        "print(most, len(bc.simulate(scene, samples=most, duration=0.1)))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    said, counts = done.stdout.splitlines()
    assert re.fullmatch(r"100000000 samples need about 4 GB of memory, [\d.]+ [MG]B are free; at most \d+ fit", said)
    most, rows = map(int, counts.split())
    assert most == rows > 10**6


def test_memory_that_is_there_is_not_refused(monkeypatch):
    free = free_memory()
    assert free is None or free > 10**8
    check_rows(1001, 12, 12)
    monkeypatch.setattr("bellcrank.memory.free_memory", lambda: 0)
    check_memory(1000, 1000.0, "rows")  # so little is not looked at
    with pytest.raises(InputError, match=r"100000000 rows need about 0.8 GB of memory, 0 MB are free; at most 0 fit"):
        check_memory(10**8, 8.0, "rows")
    monkeypatch.setattr("bellcrank.memory.free_memory", lambda: None)  # where the system does not say
    check_memory(10**12, 1e6, "rows")


def test_the_memory_of_a_group_counts_the_files_it_caches_as_free(tmp_path, monkeypatch):
    from bellcrank import memory

    monkeypatch.setattr(memory, "_CGROUP", tmp_path)
    real = Path.read_text
    monkeypatch.setattr(
        Path, "read_text", lambda self, **k: "0::/a/b\n" if str(self) == "/proc/self/cgroup" else real(self, **k)
    )
    for folder, most in ((tmp_path, None), (tmp_path / "a", "1000"), (tmp_path / "a" / "b", "max")):
        folder.mkdir(exist_ok=True)
        if most is not None:
            (folder / "memory.max").write_text(most + "\n")
            (folder / "memory.current").write_text("900\n")
            (folder / "memory.stat").write_text("anon 100\nactive_file 300\ninactive_file 400\n")
    assert memory._of_group() == [800]


@pytest.mark.tier2
def test_a_variable_of_the_progress_bar_that_it_does_not_take_is_named(tmp_path):
    codes, said = run(tmp_path, "simulate|pendulum|--duration|0.1|--no-plots", TQDM_MININTERVAL="often")
    assert codes == [2] and said.startswith("bellcrank: environment variable TQDM_") and "'often'" in said


@pytest.mark.tier2
def test_letters_that_the_font_lacks_are_drawn_without_a_warning(tmp_path, recwarn):
    scene = tmp_path / "scene.yaml"
    scene.write_text(f"name: {NAME}\nurdf: pendulum\nsimulate: {{duration: 0.1, samples: 11}}\n", encoding="utf-8")
    result = bc.simulate(scene)
    result.plot(tmp_path / "a.png")
    bc.report(result, tmp_path / "a.html")
    assert [str(warning.message) for warning in recwarn] == [] and np.isfinite(result.position).all()
