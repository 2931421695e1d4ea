"""The style of all plots: colours, dashes, grid, and figures as SVG."""

from __future__ import annotations

import contextlib
import io
import math
import os
import re
import sys
import textwrap
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from bellcrank import arguments
from bellcrank.errors import InputError
from bellcrank.files import atomic_write
from bellcrank.messages import readable, unknown_name
from bellcrank.terminal import interruption

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure


# Eight colours for any kind of colour vision: M. Okabe, K. Ito, Color Universal Design (2008).
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8A8A00")
DASHES = ("-", "--", "-.", ":")
DPI = 110
_COMPRESSION = 3  # of PNG files: 40 % less time than with the usual 6, 4 % longer files

_SVG: dict[Any, Any] = {
    "svg.fonttype": "none",  # keep text as text
    "svg.hashsalt": "bellcrank",  # the same figure gives the same bytes
    "font.sans-serif": ["DejaVu Sans", "Verdana"],  # stands in every text
    "path.simplify_threshold": 0.4,  # points; a printer's line is wider
}
_DIGITS = re.compile(r"(\.\d)\d+")
_PATH = re.compile(r' d="[^"]*"')
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_BREAK = re.compile(r"(?<!\s)[^\S\n]*\n\s*")  # with the blanks around; not begun within them again and again


def colour(k: int) -> str:
    """The colour of the k-th line."""
    return PALETTE[k % len(PALETTE)]


def dash(k: int) -> str:
    """The dashes of the k-th line, which differ also where colours repeat or are printed in black and white."""
    return DASHES[(k + k // len(PALETTE)) % len(DASHES)]


def literal(text: str, width: int | None = None) -> str:
    """A text with names from files, for Matplotlib, optionally broken into lines of `width` characters.

    A dollar sign does not start mathematics, a leading underscore does not hide a line from the legend, and an invalid
    character becomes a question mark.
    """
    text = readable(text)
    text = textwrap.fill(text, width) if width else text
    return (" " if text.startswith("_") else "") + text.replace("$", r"\$")


def load_matplotlib() -> None:
    """Import Matplotlib even where MPLBACKEND names an unknown backend; figures here do not use it."""
    if "matplotlib" in sys.modules:
        return
    backend = os.environ.pop("MPLBACKEND", None)
    try:
        import matplotlib

        if interruption.in_command():
            _without_docstrings()
    finally:
        if backend is not None:
            os.environ["MPLBACKEND"] = backend
    if backend:
        with contextlib.suppress(ValueError):
            matplotlib.rcParams["backend"] = backend  # what its import does with the variable


def _without_docstrings() -> None:
    """Matplotlib writes the docstrings of all classes when it is imported, a third of its time; commands show none."""
    from matplotlib.artist import Artist

    if hasattr(Artist, "_update_set_signature_and_docstring"):
        Artist._update_set_signature_and_docstring = classmethod(lambda _: None)


def save_figure(figure: Figure, file: Path | IO[bytes], kind: str, **options: Any) -> None:
    """Write a figure as `kind`, such as "png". Without warnings: characters missing in the font are drawn as boxes, and
    an axis of values near 1e308 has fewer ticks.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from")
        warnings.filterwarnings("ignore", category=RuntimeWarning, module="matplotlib")
        if kind == "png" and set(options) == {"dpi"}:
            _save_png(figure, file, options["dpi"])
        else:
            figure.savefig(file, format=kind, **options)


def _save_png(figure: Figure, file: Path | IO[bytes], dpi: float) -> None:
    """As `savefig`, which draws twice: the first time only to place the axes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import to_rgba
    from PIL import Image

    canvas, layout, before = FigureCanvasAgg(figure), figure.get_layout_engine(), figure.dpi
    try:
        figure.dpi = dpi
        if layout is not None:
            layout.execute(figure)
            figure.set_layout_engine("none")
        canvas.draw()  # type: ignore[no-untyped-call]
        pixels = canvas.buffer_rgba()  # type: ignore[no-untyped-call]
        picture = Image.frombuffer("RGBA", canvas.get_width_height(), pixels, "raw", "RGBA", 0, 1)
        if to_rgba(figure.get_facecolor())[3] == 1.0:
            picture = picture.convert("RGB")  # nothing shines through
        picture.save(file, "png", dpi=(dpi, dpi), compress_level=_COMPRESSION)
    finally:
        figure.dpi = before
        if layout is not None:
            figure.set_layout_engine(layout)


def write_figure(figure: Figure, path: str | Path | None) -> Figure:
    """Write a figure in the format of the path's suffix, PNG without one, and return it; nothing is written for None.

    Raises InputError where the format is not known or the file cannot be written.
    """
    target = arguments.picture(path)
    if target is not None:
        kind = target.suffix.lower().removeprefix(".") or "png"
        known = figure.canvas.get_supported_filetypes()
        if kind not in known:
            raise InputError(f"{target}: {unknown_name('picture format', kind, sorted(known))}")
        with atomic_write.writing(target) as temporary:
            save_figure(figure, temporary, kind, dpi=DPI)
    return figure


def write_figures(figures: Mapping[str, Callable[[], Figure]], folder: Path) -> list[Path]:
    """Draw figures, given by file name, as PNG into a folder, every other one in a second process.

    Returns their paths. Raises InputError where a file cannot be written.
    """

    names = list(figures)
    some, others = ({name: figures[name] for name in names[k::2]} for k in (0, 1))
    with figures_aside(others, folder) as written:
        _write_figures(some, folder)
        written()
    return [folder / name for name in figures]


def _write_figures(figures: Mapping[str, Callable[[], Figure]], folder: Path) -> None:
    for name, draw in figures.items():
        with atomic_write.writing(folder / name) as temporary:
            save_figure(draw(), temporary, "png", dpi=DPI)


@contextlib.contextmanager
def figures_aside(figures: Mapping[str, Callable[[], Figure]], folder: Path) -> Iterator[Callable[[], list[Path]]]:
    """Draw figures, given by file name, as PNG into a folder in a second process during the block.

    Yields a function that waits for them and returns their paths. Where the second process did not write them it draws
    them, and raises InputError where a file cannot be written.
    """
    if not figures:
        yield list
        return
    new_figure(1.0, 1.0)  # what Matplotlib imports, both processes have
    with _second_process(lambda: _write_figures(figures, folder)) as done:

        def written() -> list[Path]:
            if not done():
                _write_figures(figures, folder)  # here: what fails is said here
            return [folder / name for name in figures]

        yield written


@contextlib.contextmanager
def _second_process(work: Callable[[], None]) -> Iterator[Callable[[], bool]]:
    """Run `work` in a copy of this process during the block; yield a function that waits and says whether it was done.

    It is not where there is one processor, no such copy (Windows), or another thread, which a copy would not have.
    """
    if (os.cpu_count() or 1) < 2 or not hasattr(os, "fork") or threading.active_count() > 1:
        yield lambda: False
        return
    sys.stdout.flush()
    sys.stderr.flush()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads of libraries, which are asleep
        child = os.fork()
    if child == 0:
        status = 1
        try:
            work()
            status = 0
        finally:
            os._exit(status)
    waited: list[int] = []

    def done() -> bool:
        if not waited:
            waited.append(os.waitpid(child, 0)[1])
        return waited[0] == 0

    try:
        yield done
    finally:
        done()


def new_figure(width: float, height: float, free: bool = False) -> Figure:
    """A figure of `width` x `height` inches without a window system, so that drawing works anywhere.

    Matplotlib places its axes unless it is `free` (see `place`).
    """
    load_matplotlib()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="none" if free else "constrained")  # type: ignore[arg-type]
    FigureCanvasAgg(figure)
    return figure


def place(
    figure: Figure, *, left: float = 0.95, right: float = 0.15, top: float = 0.65, bottom: float = 0.55,
    across: float = 1.1, between: float = 0.4,
) -> None:  # fmt: skip
    """Place the axes of a `free` figure, which stand in one grid, by distances in inches: from the edges and between.

    Their labels stand at fixed distances too. The constrained layout of Matplotlib, which this replaces, measures all
    labels twice and takes longer than drawing.
    """
    spec = figure.axes[0].get_subplotspec()
    assert spec is not None
    rows, columns = spec.get_gridspec().get_geometry()
    width, height = figure.get_size_inches()
    wide = (width - left - right - across * (columns - 1)) / columns
    high = (height - top - bottom - between * (rows - 1)) / rows
    figure.subplots_adjust(
        left / width, bottom / height, 1.0 - right / width, 1.0 - top / height, across / wide, between / high
    )
    out = 0.7  # inches: beside "−0.025", and nearer to its own axes than to those on the left
    for axis in figure.axes:
        axis.yaxis.set_label_coords(-out / wide, 0.5)
        axis.xaxis.set_label_coords(0.5, -0.3 / (axis.get_position().height * height))


def heading(figure: Figure, text: str) -> float:
    """Write a title at the upper edge of a `free` figure, and return how many inches it takes."""
    text = literal(text, 90)
    figure.suptitle(text, y=1.0 - 0.08 / figure.get_figheight(), va="top")
    return 0.15 + 0.2 * (1 + text.count("\n"))


def legend_below(figure: Figure, entries: Mapping[str, Any]) -> float:
    """Write a legend, the handles by their labels, at the lower edge, and return how many inches it takes."""
    columns = legend_columns(list(entries), figure)
    figure.legend(
        list(entries.values()), list(entries), loc="lower center", ncols=columns, frameon=False, fontsize="small",
        borderaxespad=0.2,
    )  # fmt: skip
    return 0.1 + 0.18 * math.ceil(len(entries) / columns)


def plain(axis: Axes) -> None:
    """Draw a thin grid, and no frame at the top and right."""
    axis.grid(visible=True, color="0.9", linewidth=0.6)
    axis.spines[["top", "right"]].set_visible(False)


def title_above(axis: Axes, text: str, **style: Any) -> None:
    """Write a title above axes whose limits are known.

    Matplotlib measures all labels to keep a title off the factor of an axis ("1e-7"), which takes a fifth of drawing;
    here it does so only where there may be such a factor.
    """
    low, high = axis.get_ylim()
    largest = max(abs(low), abs(high))
    none = axis.get_yscale() != "linear" or (1e-3 <= largest < 1e5 and high - low > 0.02 * largest)
    axis.set_title(text, y=1.0 if none else None, **style)


def powers_of_ten(axis: Axis) -> None:
    """Label a logarithmic axis with powers as plain text, which is drawn without the parser of mathematics."""
    from matplotlib.ticker import FuncFormatter

    axis.set_major_formatter(FuncFormatter(lambda value, _: _power(value)))


def _power(value: float) -> str:
    if not value:
        return "0"
    exponent = math.log10(abs(value))
    power = f"{round(exponent)}".translate(_RAISED)
    return f"{'−' if value < 0 else ''}10{power}" if abs(exponent - round(exponent)) < 1e-9 else f"{value:g}"


def svg_of(figure: Figure) -> str:
    """The figure as SVG text, with curves to within half a point and without a date."""
    import matplotlib

    buffer = io.BytesIO()
    with matplotlib.rc_context(_SVG):
        save_figure(figure, buffer, "svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    text = _PATH.sub(lambda found: _DIGITS.sub(r"\1", found[0]), buffer.getvalue().decode("utf-8"))
    return _BREAK.sub(" ", text).replace("> <", "><")  # a third less


def legend_columns(labels: list[str], figure: Figure) -> int:
    """As many legend columns as fit the figure's width: about 0.085 inches a character, and 0.65 inches for a key."""
    width = 0.085 * max(map(len, labels)) + 0.65
    return max(1, min(6, len(labels), int(figure.get_figwidth() / width)))
