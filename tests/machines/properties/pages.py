"""Pages that replay a run: what they carry is the run, and they load nothing; reports and pictures."""

import csv
import html
import re

import matplotlib.image
import numpy as np
import pinocchio as pin
import pytest
from page_series import decoded, value_at

import bellcrank as bc

HOSTILE = '<b onclick=alert(1)> & "quoted" </script>'
ENERGIES = {"kinetic T": "kinetic energy", "potential V": "potential energy", "work W": "work"}


def loads_nothing(text):
    """Whether a page names no other place to load from, and forbids that anything is loaded."""
    outside = re.findall(r"""(?:src|href|action)\s*=\s*["']?(?!data:|#|["'])[^\s>]+""", text)
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)[1]
    return not re.search(r"https?://", text) and not outside and policy.startswith("default-src 'none'")


class Pages:
    @pytest.fixture(scope="class")
    def shown(self, loaded, level, tmp_path_factory):
        """A run with events, its page, and the film in it."""
        run = bc.simulate(loaded, overrides={"level": level})
        text = bc.replay(run, tmp_path_factory.mktemp("page") / "run.html", title=HOSTILE).read_text()
        return run, text, decoded(text)

    @staticmethod
    def common_rows(times, run):
        """Places of times that are times of rows, and these rows."""
        row = np.clip(np.searchsorted(run.time, times - 1e-7), 0, len(run) - 1)
        same = np.flatnonzero(np.abs(run.time[row] - times) < 1e-6)
        assert len(same) >= 2
        return same, row[same]

    def test_a_page_loads_nothing_and_escapes_names(self, shown):
        _, text, film = shown
        assert loads_nothing(text) and HOSTILE not in text and "<b onclick" not in text
        assert film["title"] == HOSTILE and html.escape(HOSTILE, quote=False) in text.replace("&quot;", '"')

    def test_lines_of_plots_are_the_columns_of_the_run(self, shown, tmp_path):
        run, _, film = shown
        with run.to_csv(tmp_path / "run.csv").open(newline="") as file:
            titles, *rows = list(csv.reader(file))
        columns = {title.rpartition(" [")[0]: [float(row[k]) for row in rows] for k, title in enumerate(titles)}
        count = 0
        for chart in film["charts"]:
            lines = [] if chart["logarithmic"] else chart["lines"]
            values = {line["name"]: columns.get(_column(chart["title"], line["name"])) for line in lines}
            values |= {"T + V": run.total_energy} if "T + V" in values else {}
            size = max([np.abs(x).max() for x in values.values()], default=0.0)
            for line in lines:
                expected = np.array(values[line["name"]])
                span = np.ptp(np.append(line["values"], expected))
                assert np.abs(value_at(line, run.time) - expected).max() <= chart["tolerance"] * span + 1e-6 * size
                count += 1
        assert count >= 3 * run.robot.nv

    def test_bodies_are_where_pinocchio_has_them(self, shown, plain_scene):
        run, _, film = shown
        bodies = [body["name"] for body in film["bodies"]]
        known = [k for k, name in enumerate(bodies) if plain_scene.tree.model.existFrame(name, pin.FrameType.BODY)]
        assert len(known) >= len(bodies) - 1  # a payload is a body too
        places = film["positions"].reshape(len(film["time"]), -1, 3)
        turns = film["quaternions"].reshape(len(film["time"]), -1, 4)
        for frame, row in list(zip(*self.common_rows(film["time"], run), strict=True))[::7]:
            plain_scene.at(run.time[row], run.position[row], run.velocity[row])
            for k in known:
                expected = plain_scene.frame(bodies[k])
                assert places[frame, k] == pytest.approx(expected.position, abs=film["error_bound"])
                x, y, z, w = turns[frame, k]
                rotation = pin.Quaternion(w, x, y, z).normalized().toRotationMatrix()
                assert rotation == pytest.approx(expected.rotation, abs=2e-3)

    def test_springs_arrows_and_traces_are_those_of_the_run(self, shown, machine):
        run, _, film = shown
        hook, eye = run.frame("hook").position, run.frame("eye").position
        point = np.array(run.scene.data["forces"][self.force(run, "tie")]["point"])
        same, rows = self.common_rows(film["time"], run)
        springs = {spring["name"]: spring["ends"][same] for spring in film["springs"]}
        expected = {"tie": np.hstack([hook[rows], np.tile(point, (len(rows), 1))])}
        expected["cord"] = np.hstack([eye[rows], 0.0 * eye[rows]])
        if machine.loads.links[0] != machine.loads.links[1]:
            expected["band"] = np.hstack([eye[rows], hook[rows]])
        assert springs.keys() == expected.keys()
        for name, ends in springs.items():
            assert ends == pytest.approx(expected[name], abs=film["error_bound"])
        arrows = {arrow["name"]: arrow for arrow in film["arrows"]}
        for name, at in {"push": hook, "jet": eye}.items():
            for what, part in {"force": slice(0, 3), "torque": slice(3, 6)}.items():
                arrow = arrows[f"{name} {what}"]
                same, rows = self.common_rows(arrow["time"], run)
                vectors = run.output(f"force_{name}")[rows, part]
                assert arrow["vectors"][same] == pytest.approx(vectors, abs=2e-3 * np.abs(vectors).max())
                assert arrow["points"][same] == pytest.approx(at[rows], abs=2 * film["error_bound"])
                assert arrow["is_torque"] == (what == "torque")
        for joint in machine.loads.joints:
            if f"{joint} motor" in arrows:
                arrow = arrows[f"{joint} motor"]
                same, rows = self.common_rows(arrow["time"], run)
                torque = run.joint(joint).actuator_torque[rows]
                assert np.linalg.norm(arrow["vectors"][same], axis=1) == pytest.approx(
                    np.abs(torque), abs=2e-3 * np.abs(run.joint(joint).actuator_torque).max()
                )
        trace = next(trace for trace in film["traces"] if trace["name"] == "hook")
        for segment in trace["segments"]:
            same, rows = self.common_rows(segment["time"], run)
            assert segment["points"][same] == pytest.approx(hook[rows], abs=film["error_bound"])

    @staticmethod
    def force(run, name):
        return next(k for k, entry in enumerate(run.scene.data["forces"]) if entry["name"] == name)

    def test_facts_and_marks_are_those_of_the_run(self, shown):
        run, _, film = shown
        facts = film["facts"]
        assert facts[0] == ["ended", run.message.partition(": ")[2]] and film["success"] is True
        known = dict(facts)
        assert float(known["energy drift"].split()[0]) == pytest.approx(run.energy_drift(), rel=0.1)
        assert float(known["equation residual"].split()[0]) == pytest.approx(run.equation_residual(), rel=0.1)
        energies = re.findall(r"(-?[\d.e+-]+) J", known["energy at the end"])
        expected = [run.kinetic_energy[-1], run.potential_energy[-1], run.work[-1]]
        assert [float(each) for each in energies] == pytest.approx(expected, rel=1e-5)
        assert [mark["time"] for mark in film["events"]] == pytest.approx(
            [event.time for event in run.events], abs=1e-9
        )
        assert all(mark["text"].startswith(e.name) for mark, e in zip(film["events"], run.events, strict=True))


def _column(chart, line):
    """The title of a run's column without its unit."""
    what = {"orientation": "position", "joint torque": "torque", "joint force": "torque"}.get(chart, chart)
    if what not in ("position", "velocity", "torque"):
        return ENERGIES.get(line, line)
    joint, _, component = line.rpartition(" ")
    return f"{joint} {what} {component}" if joint else f"{line} {what}"


class Reports:
    """Reports and pictures of the bundled scene's run."""

    def test_a_report_says_that_a_run_is_sound_and_why(self, run, tmp_path):
        text = bc.report(run, tmp_path / "report.html", title=HOSTILE).read_text()
        assert loads_nothing(text) and "<b onclick" not in text
        verdict = re.search(r'<section class="verdict good" aria-label="verdict">(.*?)</section>', text)[1]
        assert verdict.startswith('<span class="word">OK</span>')
        ended = run.message.partition(": ")[2]
        assert ended[0].upper() + ended[1:] in html.unescape(verdict)
        numbers = [float(each) for each in re.findall(r"(?:is|motion) (\d[\d.]*(?:e-?\d+)?)", verdict)]
        assert numbers[0] == pytest.approx(run.energy_drift(), rel=0.06)
        assert numbers[1] == pytest.approx(run.equation_residual(), rel=0.06)
        film = decoded(text)
        assert film["time"][-1] == pytest.approx(run.time[-1], abs=1e-6)

    def test_a_report_of_a_run_that_ended_early_says_so(self, run, tmp_path):
        early = bc.simulate(run.scene, run.time[-1], max_evaluations=60)
        text = bc.report(early, tmp_path / "early.html").read_text()
        assert 'class="verdict good"' not in text and "ended before its duration" in text

    def test_lines_of_a_picture_are_the_rows_and_it_is_not_blank(self, run, tmp_path):
        figure = run.plot(tmp_path / "run.png")
        axes = {axis.get_title(loc="left").partition(",")[0]: axis for axis in figure.axes}
        for title, rows in {"position": run.position, "velocity": run.velocity}.items():
            lines = [line for line in axes[title].get_lines() if len(line.get_xdata()) > 2]
            assert len(lines) == rows.shape[1]
            for line, column in zip(lines, rows.T, strict=True):
                own = np.interp(line.get_xdata(), run.time, column)
                assert line.get_ydata() == pytest.approx(own, abs=1e-3 * np.ptp(column) + 1e-12)
        picture = matplotlib.image.imread(tmp_path / "run.png")
        assert picture.shape[0] > 300 and 0.002 < (picture[..., :3].min(axis=2) < 0.6).mean() < 0.5

    def test_the_path_of_a_frame_is_drawn_in_the_plane_in_which_it_reaches_furthest(self, machine, run, tmp_path):
        name = next(name for name, output in run.scene.data["outputs"].items() if "frame" in output)
        path = run.frame(run.scene.data["outputs"][name]["frame"]).position
        figure = run.plot(tmp_path / "path.png", frame=run.scene.data["outputs"][name]["frame"])
        pieces = figure.axes[0].collections[0].get_segments()
        drawn = np.array([pieces[0][0], *(piece[-1] for piece in pieces)])
        first, second = sorted(np.argsort(np.ptp(path, axis=0))[1:])
        assert drawn == pytest.approx(path[:, [first, second]], abs=1e-12)
