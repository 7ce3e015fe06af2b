"""Where a fire extinguisher or a door lever may be: what stands out of the wall, or has the red of the bottles.

Along a column of the image, inverse depth is the same on an upright wall and grows evenly on the ground. A
morphological opening leaves both as they are, and takes away what is lower than its window.
"""

from dataclasses import dataclass
from math import ceil, exp

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.finds.quads import CONTRAST
from pipeline.frame import Frame, Intrinsics
from pipeline.sensor import SensorModel
from pipeline.tracks.find import SHAPED
from pipeline.tracks.likelihood import EXTENTS, SPREAD, THIN

(BOTTLE, *_), (LEVER, *_) = (EXTENTS[kind] for kind in SHAPED)
"""(3,) m, medians of a bottle's and a lever's extents, the longest first."""


@dataclass(frozen=True, eq=False)
class Protrusions:
    """What a frame shows that may be such an object.

    Attributes:
        picture: (H, W, 4) uint8 the frame's colours, and how far each pixel stands out, over a bottle's width.
        regions: (N, 2) int64 rows and columns of some of the pixels of each.
    """

    picture: NDArray[np.uint8]
    regions: list[NDArray[np.int64]]

    @classmethod
    def of(cls, frame: Frame, stride: int = 2) -> "Protrusions":
        """Search every so many pixels of a frame's rows and columns."""
        depth, lens = frame.every_nth(stride)
        depth = np.where(np.isfinite(depth), depth, 0)
        height = relief(depth, lens, frame.sensor)
        colours = np.ascontiguousarray(frame.rgb[stride // 2 :: stride, stride // 2 :: stride])
        masks = height > 3 * frame.sensor.sigma(depth), _is_red(colours) & (depth > 0)
        regions = [region * stride + stride // 2 for mask in masks for region in _regions(mask, depth, lens)]
        most = np.iinfo(np.uint8).max
        share = np.clip(most * height / BOTTLE[1], 0, most).astype(np.uint8)
        whole = cv2.resize(share, frame.rgb.shape[1::-1], interpolation=cv2.INTER_NEAREST)
        return cls(np.dstack([frame.rgb, whole]), regions)


def outline(region: NDArray[np.int64]) -> NDArray[np.float32]:
    """(M, 2) float32 corners, pixels, of the convex hull around a region's (N, 2) rows and columns."""
    return np.asarray(cv2.convexHull(region[:, ::-1].astype(np.float32) + np.float32(0.5))[:, 0], np.float32)


def square_around(region: NDArray[np.int64]) -> NDArray[np.float32]:
    """(4, 2) float32 corners, pixels, of the square twice as wide as a region (N, 2) is long, about its middle."""
    low, high = region.min(axis=0), region.max(axis=0) + 1
    unit = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32)
    return ((low + high)[::-1] / 2 + unit * (high - low).max()).astype(np.float32)


def relief(depth: NDArray[np.float32], lens: Intrinsics, sensor: SensorModel) -> NDArray[np.float32]:
    """(H, W) float32 m by which each return of (H, W) depth, m, stands out of what is above and below; else 0."""
    nearness = np.asarray(cv2.medianBlur(_filled(depth), 3), np.float32)
    far, out = np.float32(1 / sensor.farthest), np.zeros_like(depth)
    z = sensor.nearest
    while z < sensor.farthest:  # the nearest of each band are as large in the image as its window
        behind = np.maximum(_opened(nearness, ceil(_largest(BOTTLE[0]) * lens.fy / z) | 1), far)
        band = (depth >= z) & (depth < _largest(z))
        out[band] = 1 / behind[band] - 1 / np.maximum(nearness[band], far)
        z = _largest(z)
    return out


def _filled(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W) inverse depth; without a return that of the farther of the nearest returns left and right, if any."""
    is_return, columns = depth > 0, np.arange(depth.shape[1])
    left = np.maximum.accumulate(np.where(is_return, columns, -1), axis=1) + 1
    right = np.minimum.accumulate(np.where(is_return, columns, len(columns))[:, ::-1], axis=1)[:, ::-1] + 1
    inverse = np.divide(1, depth, out=np.zeros_like(depth), where=is_return)
    padded = np.pad(inverse, ((0, 0), (1, 1)), constant_values=np.inf)
    nearest = np.minimum(*(np.take_along_axis(padded, side, axis=1) for side in (left, right)))
    return np.where(np.isfinite(nearest), nearest, 0).astype(np.float32)


def _opened(image: NDArray[np.float32], rows: int) -> NDArray[np.float32]:
    """An image opened with a window of so many rows, an odd number; its first and last row go on beyond it."""
    padded = cv2.copyMakeBorder(image, rows, rows, 0, 0, cv2.BORDER_REPLICATE)
    return np.asarray(cv2.morphologyEx(padded, cv2.MORPH_OPEN, np.ones((rows, 1), np.uint8)), np.float32)[rows:-rows]


def _is_red(rgb: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """(H, W) bool, the pixels with the hue of RAL 3000, as EN 3 asks for, in any light."""
    hue, saturation, _ = cv2.split(cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV_FULL))
    # Hues are a circle, and so are the sums of unsigned bytes.
    return (hue + np.uint8(CONTRAST) < 2 * CONTRAST) & (saturation > np.iinfo(np.uint8).max // 2)


def _regions(mask: NDArray[np.bool_], depth: NDArray[np.float32], lens: Intrinsics) -> list[NDArray[np.int64]]:
    """(N, 2) rows and columns of the connected regions of (H, W) as large as objects may be."""
    pair = np.ones((2, 2), np.uint8)  # an opening in two steps, for OpenCV's moves by a pixel
    clean = cv2.dilate(cv2.erode(mask.astype(np.uint8), pair), pair, anchor=(0, 0))
    count, number, boxes, _ = cv2.connectedComponentsWithStats(clean)
    away = np.bincount(number.ravel(), depth.ravel(), count) / boxes[:, cv2.CC_STAT_AREA]
    pixel = away / lens.fx  # m
    width, height = (boxes[:, side] * pixel for side in (cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT))
    fits = (height < _largest(BOTTLE[0])) & (width < _largest(_largest(BOTTLE[1])))  # it may hang askew
    fits &= np.maximum(width, height) > _smallest(LEVER[1])
    fits &= boxes[:, cv2.CC_STAT_AREA] * pixel**2 > THIN * _smallest(LEVER[1])
    fits[0] = False  # what is not in the mask
    found = []
    for part in np.flatnonzero(fits):
        x, y, w, h = boxes[part, : cv2.CC_STAT_AREA]
        inside = np.argwhere(number[y : y + h, x : x + w] == part)
        found.append(inside + np.array([y, x]))
    return found


def _largest(extent: float) -> float:
    """The length below which 97 % of the objects remain of whose kind ``extent`` is the median, m."""
    return extent * exp(2 * SPREAD)


def _smallest(extent: float) -> float:
    return extent * exp(-2 * SPREAD)
