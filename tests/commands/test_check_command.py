"""`bellcrank check` on mechanisms: start, mobility, gaps, and the page."""

import json
import re

from bellcrank.cli import main

BODY = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
TRIANGLE = f"""<robot name="triangle"><link name="ground"/>
<link name="left">{BODY}</link><link name="right">{BODY}</link>
<joint name="a" type="continuous"><parent link="ground"/><child link="left"/><axis xyz="0 0 1"/></joint>
<joint name="b" type="continuous"><parent link="ground"/><child link="right"/><origin xyz="3 0 0"/><axis xyz="0 0 1"/>
</joint></robot>"""
SCENE = """name: Triangle
urdf: triangle.urdf
frames: {one: {link: left, xyz: [1, 0, 0]}, two: {link: right, xyz: [LENGTH, 0, 0]}}
constraints: [{name: apex, kind: point, frame_a: one, frame_b: two}]
actuated: [a]
initial: {a: {guess: 20 deg}, b: {guess: 150 deg}}
"""


def triangle(folder, length):
    (folder / "triangle.urdf").write_text(TRIANGLE)
    (folder / "triangle.yaml").write_text(SCENE.replace("LENGTH", str(length)))
    return folder / "triangle.yaml"


def test_a_mechanism_with_a_start_reports_its_mobility(tmp_path, capsys):
    assert main(["check", str(triangle(tmp_path, 2.5))]) == 0
    text = capsys.readouterr().out
    assert "start    a consistent start was found\n" in text
    assert "mobility 0 degrees of freedom: 2 of the joints less 2 independent conditions of 2" in text
    assert "mobility 1 motor (a) actuates 0 of 0 degrees of freedom" in text
    assert "mobility motors whose motion depends on the others: a" in text


def test_a_mechanism_without_a_start_reports_its_gaps_and_draws_them(tmp_path, capsys):
    page = tmp_path / "gaps.html"
    assert main(["check", str(triangle(tmp_path, 1.5)), "--html", str(page)]) == 1
    text = capsys.readouterr().out
    assert "error    no start was found that satisfies the constraints" in text
    assert "gaps     smallest position residuals: apex 0.5 m" in text  # 3 m between the axes, 1 + 1.5 m
    html = page.read_text(encoding="utf-8")
    film = json.loads(re.search(r'<script[^>]*type="application/json"[^>]*>(.*?)</script>', html, re.DOTALL)[1])
    assert "gap apex" in json.dumps(film) and "apex 0.5 m" in json.dumps(film)


def test_a_page_has_the_name_of_its_file_and_one_name_is_for_one_file(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = triangle(tmp_path, 2.5)
    assert main(["check", str(scene), "--html"]) == 0
    assert (tmp_path / "triangle_start.html").is_file()
    capsys.readouterr()
    assert main(["check", str(scene), str(scene), "--html", "x.html"]) == 2
    assert "--page x.html: expected one file, found 2" in capsys.readouterr().err
