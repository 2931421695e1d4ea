"""What is wrong with a scene, an override or a name is one sentence, with file, key, line and the nearest name."""

import re

import pytest

import bellcrank as bc
from bellcrank.cli import main

FIELDS = "stiffness, damping, free_length, point.x, point.y, point.z"
# name: (text of the loaded scene, what it becomes, the sentence, lines from the text to the key that is named)
MISTAKES = {
    "frame": (
        "  kind: spring\n  frame_a: hook\n",
        "  kind: spring\n  frame_a: hoook\n",
        "forces[{entry}].frame_a (line {line}): unknown frame 'hoook'; did you mean 'hook'? (expected: ",
        1,
    ),
    "key of a force": (
        "  frame: hook\n  force:\n",
        "  frame: hook\n  frame_c: 1\n  force:\n",
        "forces[{entry}].frame_c (line {line}): unknown key 'frame_c'; did you mean 'frame'? (expected: ",
        1,
    ),
    "kind": (
        "  kind: wrench\n",
        "  kind: wrensh\n",
        "forces[{entry}].kind (line {line}): unknown kind 'wrensh'; did you mean 'wrench'? (expected: ",
        0,
    ),
    "direction": (
        "  direction: down\n",
        "  direction: downwards\n",
        "events[2].direction (line {line}): unknown direction 'downwards'; did you mean 'down'? (expected: up, "
        "down, any)",
        0,
    ),
    "quantity": (
        "    what: angular_velocity\n",
        "    what: spin\n",
        "outputs.hook_angular_velocity.what (line {line}): unknown what 'spin' (expected: position, velocity, "
        "rotation, angular_velocity)",
        0,
    ),
    "unit": (
        "  rtol: 1.0e-11\n",
        "  rtol: 5 kg\n",
        "simulate.rtol (line {line}): expected a number (units known here: '%'), found '5 kg'",
        0,
    ),
    "setting": (
        "  samples: 61\n",
        "  sampels: 61\n",
        "simulate.sampels (line {line}): unknown key 'sampels'; did you mean 'samples'? (expected: ",
        0,
    ),
    "parameter": (
        "    - forces.tie.stiffness\n",
        "    - forces.tie.stifness\n",
        "parameters.stiffness.sets (line {line}): force 'tie': unknown field 'stifness'; did you mean 'stiffness'? "
        f"(expected: {FIELDS})",
        -1,
    ),
}


class Messages:
    @pytest.mark.parametrize("mistake", MISTAKES)
    def test_a_mistake_in_a_scene_is_one_sentence_with_its_line(self, loaded_file, mistake):
        right, wrong, sentence, offset = MISTAKES[mistake]
        text = loaded_file.read_text()
        first = text.index(right)
        line = text[:first].count("\n") + 1 + offset
        entries = re.findall(r"^- name: ", text[text.index("\nforces:") : first], flags=re.M)
        file = loaded_file.with_name("wrong.yaml")
        file.write_text(text.replace(right, wrong, 1))
        with pytest.raises(bc.InputError) as error:
            bc.load_scene(file)
        found = str(error.value)
        assert found.startswith(f"{file}: {sentence.format(line=line, entry=len(entries))}") and "\n" not in found

    def test_a_scene_that_is_wrong_exits_with_2_and_writes_nothing(self, loaded_file, tmp_path, capsys):
        file = loaded_file.with_name("wrong.yaml")
        file.write_text(loaded_file.read_text().replace("frame_a: hook", "frame_a: hoook", 1))
        assert main(["simulate", str(file), "--out", str(tmp_path / "out")]) == 2
        printed = capsys.readouterr()
        assert printed.err.startswith(f"bellcrank: {file}: forces[") and printed.err.count("\n") == 1
        assert printed.out == "" and not (tmp_path / "out").exists()

    def test_wrong_numbers_are_refused_with_the_bound_that_they_break(self, loaded):
        for path, value, sentence in (
            ("simulate.duration", -1, "expected more than 0 s, found -1"),
            ("simulate.rtol", 0, "expected more than 0, found 0"),
            ("simulate.samples", 0, "expected a whole number of 1 or more, found 0"),
            ("forces.tie.damping", -2.5, "expected 0 N s/m or more, found -2.5"),
            ("forces.tie.stiffness", "3 kg", "expected a number in N/m"),
            ("forces.push.force", [1, 2], "expected a list of 3 numbers in N, found a list of 2"),
            ("frames.hook.xyz", [1, "2 kg", 3], "expected a length in m"),
            ("outputs.mixed.expression", "sin(x=t)", "expected numbers, names, + - * / ** and functions"),
            ("outputs.mixed.expression", "sinh(t)", "unknown function 'sinh'; did you mean 'sin'?"),
            ("outputs.mixed.expression", "frame('hook').w", "unknown"),
        ):
            with pytest.raises(bc.InputError) as error:
                bc.simulate(loaded, overrides={path: value})
            assert path.split(".")[-1] in str(error.value) and sentence in str(error.value), str(error.value)
            assert "\n" not in str(error.value)

    def test_names_that_a_run_does_not_have_are_refused_with_the_nearest(self, loaded_run):
        run, scene = loaded_run, loaded_run.scene
        calls = {
            "unknown output 'hook_positon'; did you mean 'hook_position'?": lambda: run.output("hook_positon"),
            "unknown frame 'hoock'; did you mean 'hook'?": lambda: run.frame("hoock"),
            "this run has no sensitivities; name them in simulate(…, sensitivities=": lambda: run.sensitivity("load"),
            "unknown key or parameter 'stifness'; did you mean 'stiffness'?": lambda: scene.with_overrides(
                {"stifness": 1}
            ),
        }
        for sentence, call in calls.items():
            with pytest.raises(bc.InputError) as error:
                call()
            assert sentence in str(error.value)
