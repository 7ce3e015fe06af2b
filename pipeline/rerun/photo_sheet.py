"""Photos side by side with captions, as one image for Rerun."""

from collections.abc import Sequence
from math import ceil, sqrt

import cv2
import numpy as np
import rerun as rr
from PIL import Image, ImageOps

from pipeline.arrays import Rgb
from pipeline.rerun.drawings import FONT, Colour, colour_image


def sheet(photos: Sequence[tuple[str, Rgb, Colour]], side: int) -> rr.EncodedImage:
    """Photos with captions, row by row in a square.

    Args:
        photos: each photo's caption, the photo, and the caption's colour.
        side: side of a photo, caption included, pixels. Sheets are scaled to the size of 3 × 3 photos, because the
            viewer takes the JPEGs of one entity for a video.
    """
    cells = [_photo(*photo, side) for photo in photos]
    row = ceil(sqrt(len(cells))) or 1
    cells += [np.zeros((side, side, 3), np.uint8)] * (row**2 - len(cells))
    whole = np.vstack([np.hstack(cells[k : k + row]) for k in range(0, len(cells), row)])
    size = 3 * side, 3 * side
    return colour_image(np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), np.uint8))


def _photo(text: str, photo: Rgb, colour: Colour, side: int) -> Rgb:
    """A photo, scaled to fit above its caption."""
    (_, caption), _ = cv2.getTextSize(text, *FONT, thickness=1)
    fitted = np.asarray(ImageOps.pad(Image.fromarray(photo), (side, side - 2 * caption)))
    cell = np.vstack([fitted, np.zeros((2 * caption, side, 3), np.uint8)])
    cv2.putText(cell, text, (caption, side - caption // 2), *FONT, colour, 1, cv2.LINE_AA)
    return cell
