"""Compose pictures on a dark background, which suits the site's light and dark themes alike."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from pipeline.arrays import Rgb
from pipeline.labels import COLOURS, PLAIN_NAMES, Label
from pipeline.lettering import width_of, write

IMAGES = Path(__file__).parents[2] / "docs" / "images"
BACKGROUND, INK, DIM_INK = (24, 27, 31), (235, 235, 235), (160, 165, 170)
"""RGB of the background, of text, and of less important text."""
GAP, LETTER_HEIGHT = 8, 18
"""Gap between pictures, and height of letters, pixels."""


def beside(*pictures: Rgb, gap: int = GAP) -> Rgb:
    """Pictures side by side, aligned at the top."""
    height, width = max(p.shape[0] for p in pictures), sum(p.shape[1] for p in pictures)
    sheet = blank(width + gap * (len(pictures) - 1), height)
    left = 0
    for picture in pictures:
        sheet[: picture.shape[0], left : left + picture.shape[1]] = picture
        left += picture.shape[1] + gap
    return sheet


def stacked(*pictures: Rgb, gap: int = GAP) -> Rgb:
    """Pictures one above the other, aligned at the left."""
    return beside(*(picture.swapaxes(0, 1) for picture in pictures), gap=gap).swapaxes(0, 1)


def blank(width: int, height: int) -> Rgb:
    """An empty picture in the background's colour."""
    return np.full((height, width, 3), BACKGROUND, np.uint8)


def titled(picture: Rgb, title: str, size: int = LETTER_HEIGHT) -> Rgb:
    """The picture with a line of text above it."""
    bar = blank(picture.shape[1], 2 * size)
    write(bar, (size // 2, round(1.4 * size)), title, size, INK)
    return np.vstack([bar, picture])


def captioned(picture: Rgb, text: str, size: int = LETTER_HEIGHT) -> Rgb:
    """The picture with a text on a patch of background in its upper left corner."""
    picture = picture.copy()
    picture[: round(1.6 * size), : width_of(text, size) + size] = BACKGROUND
    write(picture, (size // 2, round(1.15 * size)), text, size, INK)
    return picture


def legend(labels: Sequence[Label], width: int, size: int = LETTER_HEIGHT) -> Rgb:
    """The names and colours of labels in one line."""
    line, left = blank(width, 2 * size), size // 2
    for label in labels:
        line[size // 2 : size // 2 + size, left : left + size] = COLOURS[label]
        write(line, (left + round(1.4 * size), round(1.35 * size)), PLAIN_NAMES[label], size, INK)
        left += round(2.6 * size) + width_of(PLAIN_NAMES[label], size)
    return line


def on_background(picture: Rgb) -> Rgb:
    """A rendered picture with the background's colour, instead of black, where the renderer drew nothing."""
    return np.where(picture.any(axis=2, keepdims=True), picture, np.array(BACKGROUND, np.uint8))


def scaled(picture: Rgb, factor: float) -> Rgb:
    """The picture reduced by a factor."""
    return np.asarray(cv2.resize(picture, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA), np.uint8)


def save(name: str, picture: Rgb, quality: int = 85) -> None:
    """Write a picture into the folder of the documentation's images."""
    path = IMAGES / name
    Image.fromarray(picture).save(path, quality=quality, optimize=True)
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB", flush=True)
