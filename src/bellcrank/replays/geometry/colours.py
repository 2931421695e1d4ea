"""Colours (red, green, blue, opacity; 0 to 1 each) and the mean colours of textures."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from io import BytesIO

import numpy as np

Colour = tuple[float, float, float, float]
GREY: Colour = (0.7, 0.7, 0.7, 1.0)  # in place of a texture that cannot be read
MOST_PIXELS, MOST_DECODED = 64_000_000, 256_000_000  # of one texture, and of all textures of one file
# excludes formats for which Pillow starts other programs, such as EPS
FORMATS = "PNG JPEG TGA BMP DIB GIF TIFF WEBP DDS PPM JPEG2000 PCX SGI PSD ICO".split()


def texture_colour(data: bytes | None) -> Colour | None:
    """The mean colour of the opaque part of an image file; None if it cannot be read or is too large."""
    return _mean_colour(data, MOST_PIXELS)[0]


class Textures:
    """The mean colours of the textures of one file, by name; each is read once, up to MOST_DECODED pixels in total."""

    def __init__(self, content: Callable[[str], bytes | None]) -> None:
        self._content, self._left = content, MOST_DECODED
        self._known: dict[str, Colour | None] = {}

    def colour(self, name: str) -> Colour | None:
        """The mean colour of a texture; None if it cannot be read, or if those before it used up the pixels allowed."""
        if name not in self._known:
            self._known[name], pixels = _mean_colour(self._content(name), min(MOST_PIXELS, self._left))
            self._left -= pixels
        return self._known[name]


def _mean_colour(data: bytes | None, most: int) -> tuple[Colour | None, int]:
    """The mean colour of an image file, and the number of pixels decoded for it."""
    from PIL import Image, ImageStat

    pixels = 0
    try:
        with warnings.catch_warnings(action="ignore"):  # of Pillow, about large images
            image = Image.open(BytesIO(data or b""), formats=FORMATS)
            if image.width * image.height > most:
                return None, 0
            pixels = image.width * image.height
            image.draft("RGB", (64, 64))  # JPEG files can be read small
            whole = image.convert("RGBA")
            red, green, blue = ImageStat.Stat(whole.convert("RGB"), whole.getchannel("A")).mean
            return clip_colour((red / 255.0, green / 255.0, blue / 255.0, 1.0)), pixels
    except Exception:  # an invalid file may raise anything
        return None, pixels


def clip_colour(colour: Colour) -> Colour:
    """The colour with each number limited to 0 to 1; ValueError if one is not finite."""
    if not np.isfinite(colour).all():
        raise ValueError("a colour is not finite")
    red, green, blue, opacity = (round(min(max(float(x), 0.0), 1.0), 4) for x in colour)
    return red, green, blue, opacity
