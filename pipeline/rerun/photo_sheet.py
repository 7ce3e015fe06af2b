"""Photos side by side with captions, as one image for Rerun."""

from collections.abc import Sequence
from math import ceil, sqrt

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray
from PIL import Image, ImageOps

from pipeline.rerun.drawings import FONT, Colour, colour_image

PHOTO = 240
"""Pixels of a photo's sides, its caption included; all sheets are as large as nine, for the viewer takes JPEGs of one
entity for a video."""


def sheet(photos: Sequence[tuple[str, NDArray[np.uint8], Colour]]) -> rr.EncodedImage:
    """Photos (h, w, 3) with their captions and these colours, row by row, as many in a row as there are rows."""
    cells = [_photo(*photo) for photo in photos]
    side = ceil(sqrt(len(cells))) or 1
    cells += [np.zeros((PHOTO, PHOTO, 3), np.uint8)] * (side**2 - len(cells))
    whole = np.vstack([np.hstack(cells[k : k + side]) for k in range(0, len(cells), side)])
    size = 3 * PHOTO, 3 * PHOTO
    return colour_image(np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA), np.uint8))


def _photo(text: str, photo: NDArray[np.uint8], colour: Colour) -> NDArray[np.uint8]:
    """A photo, scaled to fit its place, above its caption."""
    (_, caption), _ = cv2.getTextSize(text, *FONT, thickness=1)
    fitted = np.asarray(ImageOps.pad(Image.fromarray(photo), (PHOTO, PHOTO - 2 * caption)))
    cell = np.vstack([fitted, np.zeros((2 * caption, PHOTO, 3), np.uint8)])
    cv2.putText(cell, text, (caption, PHOTO - caption // 2), *FONT, colour, 1, cv2.LINE_AA)
    return cell
