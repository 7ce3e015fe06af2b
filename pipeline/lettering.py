"""Text in images, in the typeface that comes with Pillow, so that the text looks the same on every machine."""

import re
import unicodedata
from functools import cache
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from pipeline.arrays import Rgb

ON_LINE, IN_MIDDLE = "ls", "mm"
"""The point of a text that lies at the given position: the left end of its baseline, or its centre (Pillow's text
anchors)."""
LOOKALIKES = str.maketrans("×−–—‘’“”ıµ", "x---''\"\"iu")
"""Replacements for characters that the typeface lacks; it has ASCII and a few other characters."""


@cache
def font(size: float) -> Any:
    """The typeface with a nominal height of ``size`` pixels; its capitals are 0.7 times as tall."""
    return ImageFont.load_default(size)


def width_of(text: str, size: float) -> int:
    """The width of a line of text, pixels."""
    return int(np.ceil(font(size).getlength(_written(text))))


def write(
    image: Rgb,
    at: tuple[int, int],
    text: str,
    size: float,
    colour: tuple[int, ...],
    anchor: str = ON_LINE,
    is_smooth: bool = True,
) -> None:
    """Write a line of text into an image.

    Args:
        image: the image, which is modified in place; text beyond its edges is cut off.
        at: column and row of the anchor.
        text: the text; each run of line breaks and other white space becomes one space. Characters that the typeface
            lacks are replaced by similar characters or question marks.
        size: nominal height of the letters, pixels.
        colour: RGB.
        anchor: ``ON_LINE`` or ``IN_MIDDLE``.
        is_smooth: whether the letters' edges are blended with the image; otherwise only ``colour`` itself is used.
    """
    picture = Image.fromarray(image)
    draw = ImageDraw.Draw(picture)
    draw.fontmode = "L" if is_smooth else "1"
    draw.text(at, _written(text), tuple(colour), font(size), anchor=anchor)
    image[:] = np.asarray(picture)


def _written(text: str) -> str:
    """The text in one line, in characters that the typeface has."""
    letters = unicodedata.normalize("NFKD", " ".join(text.split()).translate(LOOKALIKES))
    return re.sub("[^ -~°]", "?", re.sub("[\u0300-\u036f]", "", letters))  # Without accents
