"""Find regions that may be a fire extinguisher ("bottle") or a door lever, by relief or by a bottle's red colour.

Along a column of the image, inverse depth is constant on an upright wall and increases linearly on the ground. A
morphological opening leaves both unchanged, and removes objects that are less tall than its window.
"""

from dataclasses import dataclass
from math import ceil, exp
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Depth, PixelMask, Pixels, Rgb
from pipeline.frame import Frame, Intrinsics
from pipeline.plugins.finds.config import FindsConfig, ShapesConfig
from pipeline.sensor import SensorModel
from pipeline.tracks.likelihood import EXTENT_SIGMA, MIN_EXTENT


@dataclass(frozen=True)
class Sizes:
    """Limits on the size of a region that may be a bottle or a lever, m or m².

    Attributes:
        median_relief: median height by which a bottle stands out, which is its width.
        max_height, max_width: maximum height and width of a region; a bottle may hang askew.
        min_longer_side: minimum longer side of a region.
        min_area: minimum area of a region.
        ratio: ratio of the largest extents to their median.
    """

    median_relief: float
    max_height: float
    max_width: float
    min_longer_side: float
    min_area: float
    ratio: float

    @classmethod
    def of(cls, config: FindsConfig) -> Self:
        """The sizes that follow from the medians and the spread of the extents."""
        bottle, lever = config.fire_extinguisher.extents[0], config.door_lever.extents[0]
        spreads = config.shapes.spreads
        larger = exp(spreads * EXTENT_SIGMA)
        smallest = lever[1] * exp(-spreads * EXTENT_SIGMA)
        max_width = bottle[1] * larger * larger
        return cls(bottle[1], bottle[0] * larger, max_width, smallest, MIN_EXTENT * smallest, larger)


@dataclass(frozen=True, eq=False)
class Protrusions:
    """The parts of a frame that may be a bottle or a lever.

    Attributes:
        picture: (H, W, 4) uint8, the frame's colours, and the height by which each pixel stands out; 255 = a
            bottle's width.
        regions: (N, 2) int64 rows and columns of some of the pixels of each region.
    """

    picture: NDArray[np.uint8]
    regions: list[NDArray[np.int64]]

    @classmethod
    def of(cls, frame: Frame, config: FindsConfig) -> Self:
        """The regions of a frame that stand out, or are red, and have the size of bottles or levers."""
        shapes, sizes = config.shapes, Sizes.of(config)
        stride = shapes.stride
        depth, lens = frame.every_nth(stride)
        depth = np.where(np.isfinite(depth), depth, 0)
        height = relief(depth, lens, frame.sensor, sizes.max_height, sizes.ratio)
        colours = np.ascontiguousarray(frame.rgb[stride // 2 :: stride, stride // 2 :: stride])
        masks = height > shapes.noise * frame.sensor.sigma(depth), _is_red(colours, shapes) & (depth > 0)
        regions = [region * stride + stride // 2 for mask in masks for region in _regions(mask, depth, lens, sizes)]
        most = np.iinfo(np.uint8).max
        scaled = np.clip(most * height / sizes.median_relief, 0, most).astype(np.uint8)
        whole = cv2.resize(scaled, frame.rgb.shape[1::-1], interpolation=cv2.INTER_NEAREST)
        return cls(np.dstack([frame.rgb, whole]), regions)


def convex_hull(region: NDArray[np.int64]) -> Pixels:
    """Corners of the convex hull of a region, which is given by (N, 2) rows and columns of its pixels."""
    return np.asarray(cv2.convexHull(region[:, ::-1].astype(np.float32) + np.float32(0.5))[:, 0], np.float32)


def square_around(region: NDArray[np.int64]) -> Pixels:
    """Corners of a square around a region, (N, 2) rows and columns, with twice the region's longer side."""
    low, high = region.min(axis=0), region.max(axis=0) + 1
    unit = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32)
    return ((low + high)[::-1] / 2 + unit * (high - low).max()).astype(np.float32)


def relief(depth: Depth, lens: Intrinsics, sensor: SensorModel, max_height: float, ratio: float) -> Depth:
    """Height by which each return stands out from the surfaces above and below it in the image, m; 0 elsewhere.

    Args:
        depth: depth image, m.
        lens: intrinsics of the depth image.
        sensor: model of the camera that measured the depth.
        max_height: maximum height of objects that stand out, m.
        ratio: ratio of the farthest to the nearest depth of a band of depths; each band has its own window.
    """
    nearness = np.asarray(cv2.medianBlur(_filled(depth), 3), np.float32)
    far, out = np.float32(1 / sensor.farthest), np.zeros_like(depth)
    z = sensor.nearest
    while z < sensor.farthest:  # a band's window fits its nearest objects
        behind = np.maximum(_opened(nearness, ceil(max_height * lens.fy / z) | 1), far)
        band = (depth >= z) & (depth < z * ratio)
        out[band] = 1 / behind[band] - 1 / np.maximum(nearness[band], far)
        z *= ratio
    return out


def _filled(depth: Depth) -> NDArray[np.float32]:
    """(H, W) inverse depth, 1/m; gaps get the value of the farther of the nearest returns to the left and right."""
    is_return, columns = depth > 0, np.arange(depth.shape[1])
    left = np.maximum.accumulate(np.where(is_return, columns, -1), axis=1) + 1
    right = np.minimum.accumulate(np.where(is_return, columns, len(columns))[:, ::-1], axis=1)[:, ::-1] + 1
    inverse = np.divide(1, depth, out=np.zeros_like(depth), where=is_return)
    padded = np.pad(inverse, ((0, 0), (1, 1)), constant_values=np.inf)
    nearest = np.minimum(*(np.take_along_axis(padded, side, axis=1) for side in (left, right)))
    return np.where(np.isfinite(nearest), nearest, 0).astype(np.float32)


def _opened(image: NDArray[np.float32], rows: int) -> NDArray[np.float32]:
    """An image opened with a window of an odd number of rows; the first and last rows are replicated as padding."""
    padded = cv2.copyMakeBorder(image, rows, rows, 0, 0, cv2.BORDER_REPLICATE)
    return np.asarray(cv2.morphologyEx(padded, cv2.MORPH_OPEN, np.ones((rows, 1), np.uint8)), np.float32)[rows:-rows]


def _is_red(rgb: Rgb, config: ShapesConfig) -> PixelMask:
    """The pixels with a bottle's hue, in any light."""
    hue, saturation, _ = cv2.split(cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV_FULL))
    # Hues wrap around, and so do sums of unsigned bytes.
    return (hue + np.uint8(config.hue) < 2 * config.hue) & (saturation > config.min_saturation)


def _regions(mask: PixelMask, depth: Depth, lens: Intrinsics, sizes: Sizes) -> list[NDArray[np.int64]]:
    """(N, 2) rows and columns of the pixels of each connected region whose size is within the limits."""
    pair = np.ones((2, 2), np.uint8)  # an opening in two steps, because OpenCV's opening shifts the mask by a pixel
    clean = cv2.dilate(cv2.erode(mask.astype(np.uint8), pair), pair, anchor=(0, 0))
    count, number, boxes, _ = cv2.connectedComponentsWithStats(clean)
    away = np.bincount(number.ravel(), depth.ravel(), count) / boxes[:, cv2.CC_STAT_AREA]
    pixel = away / lens.fx  # m
    width, height = (boxes[:, side] * pixel for side in (cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT))
    fits = (height < sizes.max_height) & (width < sizes.max_width)
    fits &= np.maximum(width, height) > sizes.min_longer_side
    fits &= boxes[:, cv2.CC_STAT_AREA] * pixel**2 > sizes.min_area
    fits[0] = False  # label 0 is the background
    found = []
    for part in np.flatnonzero(fits):
        x, y, w, h = boxes[part, : cv2.CC_STAT_AREA]
        inside = np.argwhere(number[y : y + h, x : x + w] == part)
        found.append(inside + np.array([y, x]))
    return found
