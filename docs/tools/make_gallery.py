"""Draw gallery.png from the pages that the examples write: run the examples in a folder, then this in the same one."""

import tempfile
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from bellcrank.replays.page.rendering import render_still

SHOWN = {  # page: (time in s, caption)
    "planar_2r_sizing": (6.0, "Planar arm: motors sized over a circle"),
    "ur5_pick": (2.6, "UR5 carries 3 kg: torques of its motors"),
    "five_bar_sizing": (0.3, "Five-bar: a closed linkage, two motors"),
    "four_bar": (12.2, "Four-bar about to lock: the force in its pin"),
    "planar_2r_swing": (6.3, "Planar arm let go: the path of its tip"),
    "spring_pendulum": (9.0, "Spring pendulum: its mass bounces and swings"),
    "rolling_disk": (2.0, "Thin disk: contact's trace and force"),
    "bricard": (1.7, "Bricard's linkage: a repeated constraint"),
}
VIEW, CAPTION, COLUMNS = (400, 300), 34, 4


def few_colours(picture: Image.Image) -> Image.Image:
    """In 256 colours: half of them for the sky, which is most of it, and half for all else."""
    halves = [
        picture.quantize(128, method).getpalette() or []
        for method in (Image.Quantize.MEDIANCUT, Image.Quantize.MAXCOVERAGE)
    ]
    palette = Image.new("P", (1, 1))
    palette.putpalette([colour for half in halves for colour in half[: 3 * 128]])
    return picture.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG)


def main() -> None:
    """Draw them."""
    width, height = VIEW[0], VIEW[1] + CAPTION
    rows = -(-len(SHOWN) // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * width, rows * height), "white")
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    with tempfile.TemporaryDirectory() as folder:
        for k, (name, (time, caption)) in enumerate(SHOWN.items()):
            x, y = k % COLUMNS * width, k // COLUMNS * height
            view = Image.open(
                render_still(f"{name}.html", Path(folder) / f"{name}.png", time, (2 * VIEW[0], 2 * VIEW[1]))
            )
            sheet.paste(view.convert("RGB").resize(VIEW, Image.Resampling.LANCZOS), (x, y))
            pen.text((x + width / 2, y + VIEW[1] + CAPTION / 2), caption, "#1b2430", font, "mm")
    target = Path(__file__).parents[1] / "pictures" / "gallery.png"
    few_colours(sheet).save(target, optimize=True)
    print(f"{target}: {target.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
