"""Names and help of commands."""

import pytest

from bellcrank.cli import main


def printed(capsys, *command):
    """What a command prints that ends the parsing."""
    with pytest.raises(SystemExit, match="0"):
        main(list(command))
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("alias", "name"), [("time-optimal", "fastest"), ("linearise", "modes"), ("check_urdf", "check")]
)
def test_commands_have_the_names_of_python_too(capsys, alias, name):
    assert f"usage: bellcrank {name} " in printed(capsys, alias, "--help")


def test_select_lists_its_main_options_and_all_with_help_all(capsys):
    short, whole = (printed(capsys, "select", option) for option in ("--help", "--help-all"))
    options = [{line.split()[0] for line in text.splitlines() if line.startswith("  -")} for text in (short, whole)]
    assert len(options[0]) == 13 and options[0] < options[1] and len(options[1]) > 35
    assert "--altitude" in options[1] - options[0]


def test_an_option_that_help_leaves_out_works(capsys, tmp_path):
    assert main(["select", "geared_pendulum", "--altitude", "nonsense", "--out", str(tmp_path)]) == 2
    assert "altitude" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "options"),
    [
        ("check", []), ("simulate", ["--no-plots", "--duration", "0.5"]), ("fastest", ["--no-plots"]),
        pytest.param("size", ["--no-plots"], marks=pytest.mark.tier2),
        pytest.param("select", ["--no-plots"], marks=pytest.mark.tier2),
    ],
)  # fmt: skip
def test_every_command_writes_its_page_where_it_is_told(capsys, tmp_path, command, options):
    subject, page = "planar_2r_swing" if command == "simulate" else "geared_pendulum", tmp_path / "own.html"
    if command != "check":
        options = [*options, "--out", str(tmp_path / "out")]
    assert main([command, subject, *options, "--page", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert text.startswith("<!doctype html>") and "http-equiv" in text
    if command != "check":
        assert capsys.readouterr().out.splitlines()[-1].endswith(f", {page}")
        assert not list((tmp_path / "out").glob("*.html"))
        assert main([command, subject, *options, "--page"]) == 0
        assert len(list((tmp_path / "out").glob("*.html"))) == 1


def test_a_page_that_cannot_be_written_is_refused_before_anything_is_computed(capsys, tmp_path):
    (tmp_path / "file").write_text("")
    page = str(tmp_path / "file" / "page.html")
    assert main(["size", "planar_2r", "--out", str(tmp_path / "out"), "--page", page]) == 2
    assert "--page" in capsys.readouterr().err and not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "command", [["sweep", "pendulum", "--vary", "initial.swing=0.1,0.2"], ["fastest", "geared_pendulum"]]
)
def test_a_page_that_cannot_be_written_is_refused_before_designs_are_run(capsys, tmp_path, command):
    (tmp_path / "file").write_text("")
    page = str(tmp_path / "file" / "page.html")
    assert main([*command, "--out", str(tmp_path / "out"), "--page", page]) == 2
    assert "--page" in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_a_page_is_called_as_it_is_listed_and_older_options_take_no_file(capsys, tmp_path):
    command = ["size", "--no-plots", "--out", str(tmp_path), "geared_pendulum", "--page", str(tmp_path / "my")]
    assert main(command) == 0
    assert "my.html in" in capsys.readouterr().out and (tmp_path / "my.html").exists()
    assert main(["fastest", "--html", "geared_pendulum", "--no-plots", "--out", str(tmp_path / "fast")]) == 0
    assert "fastest_lift_and_return.html" in capsys.readouterr().out
