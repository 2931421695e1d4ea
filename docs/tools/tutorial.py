"""Run a tutorial: write its files, run its commands and Python, and compare what it says with what is printed.

Blocks of a page, in their order: ```yaml, ```csv or ```xml with title="NAME" is a file in the current folder; each line
of ```sh is a command of bellcrank, `# exit code N` after it says which code is expected (default 0); ```python blocks
share their names; ```text is what the block before it prints: its lines in order, others may stand between them;
numbers agree to three digits (to a factor of 3 where they are errors below 1e-4); `…` stands for anything.
"""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import sys
from pathlib import Path
from typing import Any

from bellcrank.cli import main

FENCE = re.compile(
    r"^```(?P<language>\w+)(?: title=\"(?P<title>[^\"]+)\")?\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
ERROR = 1e-4  # smaller numbers are errors of the method
ROUNDING = 1e-14  # and smaller ones of rounding, which differs between processors


def run(page: Path) -> dict[str, Any]:
    """Run a page in the current folder; what its Python left behind. Raises AssertionError where the page is wrong."""
    names: dict[str, Any] = {"__name__": "__main__"}
    printed = ""
    for block in FENCE.finditer(page.read_text(encoding="utf-8")):
        language, title, text = block["language"], block["title"], block["text"]
        if title:
            Path(title).write_text(text, encoding="utf-8")
        elif language == "sh":
            printed = "".join(_command(line) for line in text.splitlines() if line.strip())
        elif language == "python":
            printed = _python(text, names, page)
        elif language == "text":
            compare(text, printed)
        else:
            raise AssertionError(f"{page.name}: a block of {language} without a title")
    return names


def compare(told: str, printed: str) -> None:
    """Check that the lines of a page stand in what was printed, in their order. Raises AssertionError."""
    there = iter(printed.splitlines())
    for line in filter(str.strip, told.splitlines()):
        if not any(_alike(line, candidate) for candidate in there):
            raise AssertionError(f"the page says, but it is not printed:\n{line}\nprinted:\n{printed}")


def _alike(told: str, printed: str) -> bool:
    pattern, numbers = "", []
    for piece in re.split(rf"({NUMBER.pattern}|…|\s+)", told.strip()):
        if piece and NUMBER.fullmatch(piece):
            numbers.append(float(piece))
            pattern += f"({NUMBER.pattern})"
        else:
            pattern += ".*" if piece == "…" else r"\s+" if piece and not piece.strip() else re.escape(piece or "")
    found = re.fullmatch(pattern, printed.strip())
    return found is not None and all(map(_close, numbers, map(float, found.groups())))


def _close(told: float, printed: float) -> bool:
    if 0.0 < abs(told) < ROUNDING:
        return abs(printed) < ROUNDING
    if 0.0 < abs(told) < ERROR:
        return abs(told) / 3.0 <= abs(printed) <= abs(told) * 3.0
    return abs(told - printed) <= 1e-3 * abs(told)


def _command(line: str) -> str:
    command, _, comment = line.partition("  #")
    program, *arguments = shlex.split(command)
    assert program == "bellcrank", f"a tutorial runs bellcrank only, found: {line}"
    expected = re.search(r"exit code (\d+)", comment)
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(out):
        code = main(arguments)
    assert code == int(expected[1] if expected else 0), f"{line}: exit code {code}\n{out.getvalue()}"
    return out.getvalue()


def _python(text: str, names: dict[str, Any], page: Path) -> str:
    with contextlib.redirect_stdout(io.StringIO()) as out:
        exec(compile(text, page.name, "exec"), names)
    return out.getvalue()


if __name__ == "__main__":
    run(Path(sys.argv[1]))
