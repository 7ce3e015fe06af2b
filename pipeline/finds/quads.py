"""Squares in an image, as those that signs are printed on: outlines with four corners, found in several ways."""

from collections.abc import Iterator, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

LEAST_SIDE = 16  # Pixels along a side from which a sign may be recognised
CONTRAST = 16  # Grey levels, or 256ths of the circle of hues, within which a surface is of one colour
FILLED = 0.88  # Least share of a quadrilateral that its outline's hull fills, and of the hull's own area
SAME = 0.1  # Share of a diagonal by which corners of the same square may differ


def find_quads(rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """(N, 4, 2) corners, pixels, clockwise, of what may be squares in an (H, W, 3) image, each once."""
    found = [quad for mask in _masks(rgb) for quad in _quads_of(mask)]
    quads = np.array(found, np.float32).reshape(-1, 4, 2)
    quads = quads[_distinct(quads)]
    parts = [part for quad in quads for part in _parts(quad)]
    return np.concatenate([quads, np.array(parts, np.float32).reshape(-1, 4, 2)])


def _parts(quad: NDArray[np.float32]) -> Iterator[NDArray[np.float32]]:
    """The halves of an oblong, or the quarters of a square: signs that hang side by side have one outline."""
    sides = np.linalg.norm(np.roll(quad, -1, axis=0) - quad, axis=1)
    wide, high = sides[::2].mean(), sides[1::2].mean()
    columns, rows = (2 if one > other / 1.5 else 1 for one, other in ((wide, high), (high, wide)))
    if min(wide / columns, high / rows) < LEAST_SIDE:
        return
    unit = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    T = cv2.getPerspectiveTransform(unit, quad)
    for i, j in np.ndindex(rows, columns):
        part = ((unit + np.array([j, i])) / (columns, rows)).astype(np.float32)
        yield np.asarray(cv2.perspectiveTransform(part[None], T)[0], np.float32)


def _masks(rgb: NDArray[np.uint8]) -> Iterator[NDArray[np.uint8]]:
    """Images whose white regions may be squares: by local brightness, by colour, by edges."""
    smooth = np.asarray(cv2.medianBlur(rgb, 3), np.uint8)
    hue, saturation, value = cv2.split(cv2.cvtColor(smooth, cv2.COLOR_RGB2HSV_FULL))
    most = np.iinfo(np.uint8).max
    for channel in (value, saturation):
        for times in (1, 3, 3**2):
            window = times * (LEAST_SIDE + 1)
            local = cv2.adaptiveThreshold(channel, most, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY, window, 3)
            yield np.asarray(local, np.uint8)
            yield np.asarray(most - local, np.uint8)
    for first in range(0, most + 1, CONTRAST):
        # Hues are a circle, and so are the differences of unsigned bytes.
        is_one = (hue - np.uint8(first) < 2 * CONTRAST) & (saturation > 2**2 * CONTRAST)
        yield np.where(is_one, most, 0).astype(np.uint8)
    edges = np.max([cv2.Canny(channel, 2 * CONTRAST, 3 * 2 * CONTRAST) for channel in cv2.split(smooth)], axis=0)
    yield np.where(cv2.dilate(edges, np.ones((3, 3), np.uint8)) > 0, 0, most).astype(np.uint8)


def _quads_of(mask: NDArray[np.uint8]) -> Iterator[NDArray[np.float32]]:
    contours, _ = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)
    for contour in _large(contours):
        quad = _quad(np.asarray(cv2.convexHull(contour), np.int32))
        if quad is not None:
            yield quad


def _large(contours: Sequence[cv2.typing.MatLike]) -> Iterator[cv2.typing.MatLike]:
    """Those of contours (N, 1, 2) that are ``LEAST_SIDE`` wide and high: one in 300 of a noisy image."""
    if not contours:
        return
    begins = np.cumsum([0, *map(len, contours[:-1])])
    points = np.concatenate(contours)[:, 0]
    sides = np.maximum.reduceat(points, begins) - np.minimum.reduceat(points, begins) + 1
    yield from (contours[k] for k in np.flatnonzero(sides.min(axis=1) >= LEAST_SIDE).tolist())


def _quad(hull: NDArray[np.int32]) -> NDArray[np.float32] | None:
    """(4, 2) corners of the quadrilateral that a hull is; None if it is none, or seen at more than 70° from ahead."""
    area = cv2.contourArea(hull)
    for times in (1, 2, 3):
        corners = cv2.approxPolyDP(hull, times / 50 * cv2.arcLength(hull, True), True)[:, 0].astype(np.float32)
        if len(corners) <= 4:
            break
    if len(corners) != 4 or area < LEAST_SIDE**2:
        return None
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
    is_full = FILLED < cv2.contourArea(corners) / area < 1 / FILLED
    return corners if is_full and sides.max() < 3 * sides.min() else None


def _distinct(quads: NDArray[np.float32]) -> NDArray[np.intp]:
    """Indices of quadrilaterals of which none is the same as one before, from any corner."""
    kept: list[int] = []
    for k, quad in enumerate(quads):
        others = quads[kept]
        reach = SAME * np.linalg.norm(quad[0] - quad[2])
        near = np.linalg.norm(others.mean(axis=1) - quad.mean(axis=0), axis=1) < reach
        sizes = np.linalg.norm(others[near] - quad.mean(axis=0), axis=2).mean(axis=1)
        if not (np.abs(sizes - np.linalg.norm(quad - quad.mean(axis=0), axis=1).mean()) < reach).any():
            kept.append(k)
    return np.array(kept, np.intp)
