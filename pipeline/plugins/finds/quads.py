"""Find squares in an image, such as printed signs, as outlines with four corners."""

from collections.abc import Iterator, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Pixels, Rgb
from pipeline.plugins.finds.config import SquaresConfig


def find_quads(rgb: Rgb, config: SquaresConfig) -> NDArray[np.float32]:
    """(N, 4, 2) pixels, corners, clockwise, of the possible squares in an image, without duplicates."""
    found = [quad for mask in _masks(rgb, config) for quad in _quads_of(mask, config)]
    quads = np.array(found, np.float32).reshape(-1, 4, 2)
    quads = quads[_distinct(quads, config.same)]
    parts = [part for quad in quads for part in _parts(quad, config)]
    return np.concatenate([quads, np.array(parts, np.float32).reshape(-1, 4, 2)])


def _parts(quad: Pixels, config: SquaresConfig) -> Iterator[Pixels]:
    """The halves of an oblong or the quarters of a square, because signs that hang side by side share one outline."""
    sides = np.linalg.norm(np.roll(quad, -1, axis=0) - quad, axis=1)
    wide, high = sides[::2].mean(), sides[1::2].mean()
    columns, rows = (2 if one > other / config.oblong else 1 for one, other in ((wide, high), (high, wide)))
    if min(wide / columns, high / rows) < config.min_side:
        return
    unit = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    T = cv2.getPerspectiveTransform(unit, quad)
    for i, j in np.ndindex(rows, columns):
        part = ((unit + np.array([j, i])) / (columns, rows)).astype(np.float32)
        yield np.asarray(cv2.perspectiveTransform(part[None], T)[0], np.float32)


def _masks(rgb: Rgb, config: SquaresConfig) -> Iterator[NDArray[np.uint8]]:
    """(H, W) images in which regions, or holes in them, may be squares: from local contrast, colours and edges."""
    smooth = np.asarray(cv2.medianBlur(rgb, 3), np.uint8)
    hue, saturation, value = cv2.split(cv2.cvtColor(smooth, cv2.COLOR_RGB2HSV_FULL))
    most = np.iinfo(np.uint8).max
    yield _above(value, -config.contrast, config.small_window)
    # Inverted, because shapes that touch only at corners are joined in one of the two masks.
    yield most - _above(value, config.contrast, config.small_window)
    for above in (-config.contrast, config.contrast):
        yield most - _above(value, above, config.window)
    yield _above(saturation, config.saturation_offset, config.window)
    # On grey walls, saturation is noise, which has few outlines once its specks are removed.
    yield np.asarray(cv2.medianBlur(_above(saturation, -config.contrast, config.small_window), 5), np.uint8)
    for first in range(0, most + 1, config.hue_step):
        # Hues wrap around, and so do differences of unsigned bytes.
        is_one = (hue - np.uint8(first) < config.hue_width) & (saturation > config.min_saturation)
        if np.count_nonzero(is_one) >= config.min_side**2:
            yield np.where(is_one, most, 0).astype(np.uint8)
    thresholds = config.canny_low, config.canny_high
    edges = np.max([cv2.Canny(channel, *thresholds) for channel in cv2.split(smooth)], axis=0)
    yield np.where(cv2.dilate(edges, np.ones((3, 3), np.uint8)) > 0, 0, most).astype(np.uint8)


def _above(channel: cv2.typing.MatLike, above: int, window: int) -> NDArray[np.uint8]:
    """255 where a pixel exceeds the mean of the ``window`` × ``window`` pixels around it by more than ``above``."""
    how = cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY, window, -above
    return np.asarray(cv2.adaptiveThreshold(channel, np.iinfo(np.uint8).max, *how), np.uint8)


def _quads_of(mask: NDArray[np.uint8], config: SquaresConfig) -> Iterator[Pixels]:
    contours, _ = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)
    for contour in _large(contours, config.min_side):
        quad = _quad(np.asarray(cv2.convexHull(contour), np.int32), config)
        if quad is not None:
            yield quad


def _large(contours: Sequence[cv2.typing.MatLike], min_side: int) -> Iterator[cv2.typing.MatLike]:
    """The contours (N, 1, 2) at least ``min_side`` pixels wide and high; in a noisy image, one in 300 is so large."""
    if not contours:
        return
    begins = np.cumsum([0, *map(len, contours[:-1])])
    points = np.concatenate(contours)[:, 0]
    sides = np.maximum.reduceat(points, begins) - np.minimum.reduceat(points, begins) + 1
    yield from (contours[k] for k in np.flatnonzero(sides.min(axis=1) >= min_side).tolist())


def _quad(hull: NDArray[np.int32], config: SquaresConfig) -> Pixels | None:
    """Four corners of a hull that is a quadrilateral; None if it has another shape, is too small or too oblique."""
    area = cv2.contourArea(hull)
    for tolerance in config.tolerances:
        corners = cv2.approxPolyDP(hull, tolerance * cv2.arcLength(hull, True), True)[:, 0].astype(np.float32)
        if len(corners) <= 4:
            break
    if len(corners) != 4 or area < config.min_side**2:
        return None
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    is_full = config.filled < cv2.contourArea(corners) / area < 1 / config.filled
    return corners if is_full and sides.max() < config.max_side_ratio * sides.min() else None


def _distinct(quads: NDArray[np.float32], same: float) -> NDArray[np.intp]:
    """Indices of the quadrilaterals that do not repeat an earlier one, whichever corner comes first."""
    kept: list[int] = []
    for k, quad in enumerate(quads):
        others = quads[kept]
        reach = same * np.linalg.norm(quad[0] - quad[2])
        near = np.linalg.norm(others.mean(axis=1) - quad.mean(axis=0), axis=1) < reach
        sizes = np.linalg.norm(others[near] - quad.mean(axis=0), axis=2).mean(axis=1)
        if not (np.abs(sizes - np.linalg.norm(quad - quad.mean(axis=0), axis=1).mean()) < reach).any():
            kept.append(k)
    return np.array(kept, np.intp)
