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
    assert len(options[0]) == 12 and options[0] < options[1] and len(options[1]) > 35
    assert "--altitude" in options[1] - options[0]


def test_an_option_that_help_leaves_out_works(capsys, tmp_path):
    assert main(["select", "geared_pendulum", "--altitude", "nonsense", "--out", str(tmp_path)]) == 2
    assert "altitude" in capsys.readouterr().err
