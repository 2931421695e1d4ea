"""Draws which room imports which, docs/pictures/rooms.png: below each room a dot in the row of a room that it imports.

The area of a dot is the number of imports.

python docs/tools/rooms.py
"""

from __future__ import annotations

import tomllib
from collections import Counter
from pathlib import Path

import house

from bellcrank.present.plot_style import colour, new_figure, write_figure

ROOT = Path(__file__).resolve().parents[2]
PICTURE = ROOT / "docs" / "pictures" / "rooms.png"


def ladder() -> list[str]:
    """The rooms from the highest to the lowest, as the lint has them."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]["contracts"]
    layers = next(one["layers"] for one in contracts if one["containers"] == ["bellcrank"])
    return [room for layer in layers for room in layer.split(" : ")]


def main() -> None:
    """Writes the picture."""
    lines: Counter[str] = Counter()
    for module, text in house.texts().items():
        lines[module.split(".")[1] if "." in module else ""] += text.count("\n")
    rooms = [room for room in ladder() if (house.PACKAGE / room).is_dir()]
    graph, imports = house.imports(), Counter[tuple[str, str]]()
    for module in graph.modules:
        for other in graph.find_modules_directly_imported_by(module):
            imports[module.partition(".")[2].split(".")[0], other.partition(".")[2].split(".")[0]] += 1
    figure = new_figure(9.0, 6.0)
    axes = figure.subplots()
    for k, room in enumerate(rooms):
        below = {n: imports[room, other] for n, other in enumerate(rooms) if n > k and imports[room, other]}
        axes.hlines(-k, 0, k, color="0.9", lw=0.8, zorder=0)
        axes.vlines(k, -len(rooms) + 1, -k, color="0.9", lw=0.8, zorder=0)
        axes.scatter(
            [k] * len(below), [-n for n in below], s=[2.0 * count for count in below.values()], color=colour(k)
        )
        axes.text(k + 0.15, -k, f"{room}, {lines[room]:,} lines", va="center", fontsize=9)
        axes.plot(k, -k, "s", color=colour(k), ms=5.0)
    axes.set(xlim=(-0.7, len(rooms) + 3.5), ylim=(-len(rooms) + 0.3, 0.7))
    axes.set_axis_off()
    write_figure(figure, PICTURE)


if __name__ == "__main__":
    main()
