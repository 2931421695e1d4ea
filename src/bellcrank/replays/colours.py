"""Colours of what is drawn: red, green, blue and opacity, each from 0 to 1."""

from __future__ import annotations

from io import BytesIO

import numpy as np

Colour = tuple[float, float, float, float]
GREY: Colour = (0.7, 0.7, 0.7, 1.0)  # stands for a texture that cannot be read
MOST_PIXELS = 64_000_000


def texture_colour(data: bytes | None) -> Colour | None:
    """The mean colour of an image file where it is not see-through; None where it cannot be read."""
    from PIL import Image, ImageStat

    try:
        image = Image.open(BytesIO(data or b""))
        if image.width * image.height > MOST_PIXELS:
            return None
        image.draft("RGB", (64, 64))  # JPEG files can be read small
        pixels = image.convert("RGBA")
        red, green, blue = ImageStat.Stat(pixels.convert("RGB"), pixels.getchannel("A")).mean
        return clipped((red / 255.0, green / 255.0, blue / 255.0, 1.0))
    except Exception:  # an image reader meets whatever the file holds
        return None


def clipped(colour: Colour) -> Colour:
    """The colour with each number brought into 0 to 1; ValueError where one is no number."""
    if not np.isfinite(colour).all():
        raise ValueError("a colour is not finite")
    red, green, blue, opacity = (round(min(max(float(x), 0.0), 1.0), 4) for x in colour)
    return red, green, blue, opacity
