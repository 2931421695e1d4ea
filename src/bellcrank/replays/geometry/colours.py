"""Colours of what is drawn: red, green, blue and opacity, each from 0 to 1."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from io import BytesIO

import numpy as np

Colour = tuple[float, float, float, float]
GREY: Colour = (0.7, 0.7, 0.7, 1.0)  # stands for a texture that cannot be read
MOST_PIXELS, MOST_DECODED = 64_000_000, 256_000_000  # of one texture, and of all textures of a file
# kinds of textures: none for which Pillow starts other programs, such as EPS
FORMATS = "PNG JPEG TGA BMP DIB GIF TIFF WEBP DDS PPM JPEG2000 PCX SGI PSD ICO".split()


def texture_colour(data: bytes | None) -> Colour | None:
    """The mean colour of an image file where it is not see-through; None where it cannot be read or is too large."""
    return _mean_colour(data, MOST_PIXELS)[0]


class Textures:
    """The mean colours of the textures of one file by their names; each is read once, as far as `MOST_DECODED` goes."""

    def __init__(self, content: Callable[[str], bytes | None]) -> None:
        self._content, self._left = content, MOST_DECODED
        self._known: dict[str, Colour | None] = {}

    def colour(self, name: str) -> Colour | None:
        """The mean colour of a texture; None where it cannot be read, or the others before it were too large."""
        if name not in self._known:
            self._known[name], pixels = _mean_colour(self._content(name), min(MOST_PIXELS, self._left))
            self._left -= pixels
        return self._known[name]


def _mean_colour(data: bytes | None, most: int) -> tuple[Colour | None, int]:
    """The mean colour of an image file, and how many pixels were decoded for it."""
    from PIL import Image, ImageStat

    pixels = 0
    try:
        with warnings.catch_warnings(action="ignore"):  # Pillow's own, of large images
            image = Image.open(BytesIO(data or b""), formats=FORMATS)
            if image.width * image.height > most:
                return None, 0
            pixels = image.width * image.height
            image.draft("RGB", (64, 64))  # JPEG files can be read small
            whole = image.convert("RGBA")
            red, green, blue = ImageStat.Stat(whole.convert("RGB"), whole.getchannel("A")).mean
            return clipped((red / 255.0, green / 255.0, blue / 255.0, 1.0)), pixels
    except Exception:  # an image reader meets whatever the file holds
        return None, pixels


def clipped(colour: Colour) -> Colour:
    """The colour with each number brought into 0 to 1; ValueError where one is no number."""
    if not np.isfinite(colour).all():
        raise ValueError("a colour is not finite")
    red, green, blue, opacity = (round(min(max(float(x), 0.0), 1.0), 4) for x in colour)
    return red, green, blue, opacity
