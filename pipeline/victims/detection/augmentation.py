"""Images to train on: alone or four as a mosaic, at random scales and places, mirrored, in random colours."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.victims.detection.boxes import areas
from pipeline.victims.detection.labelled_image import LabelledImage
from pipeline.victims.detection.letterbox import GREY
from pipeline.victims.detection.pasting import pasted

Region = tuple[int, int, int, int]  # x0, y0, x1, y1 of the canvas


@dataclass(frozen=True)
class AugmentationConfig:
    """Settings of the augmentation.

    Attributes:
        mosaic: share of canvases that four images share (Bochkovskiy et al., YOLOv4, arXiv:2004.10934).
        scale: smallest and largest size of an image against the one that just fits the network's input.
        mosaic_scale: the same in a mosaic.
        hue: largest turn of the colours, as a share of the circle, as Darknet's ``hue``.
        saturation: largest factor, and 1 over it the smallest, as Darknet's.
        exposure: the same of brightness.
        paste: share of canvases onto which people of one more image are pasted.
        paste_scale: as ``scale``, of these people.
        kept: least share of a box that must be left at an edge for its person to count.
    """

    mosaic: float = 0.5
    scale: tuple[float, float] = (0.7, 1.5)
    mosaic_scale: tuple[float, float] = (0.4, 1.0)
    hue: float = 0.05
    saturation: float = 1.5
    exposure: float = 1.5
    paste: float = 0.4
    paste_scale: tuple[float, float] = (0.4, 1.2)
    kept: float = 0.3


def augmented(
    images: Sequence[LabelledImage],
    donors: Sequence[LabelledImage],
    size: tuple[int, int],
    config: AugmentationConfig,
    rng: np.random.Generator,
) -> LabelledImage:
    """A canvas of ``size`` (width, height) with one image, or with four, and the donors' people pasted onto it."""
    canvas = np.full((size[1], size[0], 3), GREY, np.uint8)
    boxes, ignored = [np.zeros((0, 4), np.float32)], [np.zeros(0, bool)]
    scale = config.scale if len(images) == 1 else config.mosaic_scale
    for image, region in zip(images, regions(len(images), size, rng), strict=True):
        ratio = _ratio(image, size, scale, rng)
        placed = place(recoloured(image, config, rng), canvas, region, ratio, config.kept, rng)
        boxes.append(placed.boxes)
        ignored.append(placed.ignored)
    whole = LabelledImage(canvas, np.concatenate(boxes), np.concatenate(ignored))
    for donor in donors:
        ratio = _ratio(donor, size, config.paste_scale, rng)
        whole = pasted(whole, recoloured(donor, config, rng), ratio, rng)
    return mirrored(whole) if rng.random() < 0.5 else whole


def _ratio(
    image: LabelledImage, size: tuple[int, int], scale: tuple[float, float], rng: np.random.Generator
) -> float:
    """A random factor of size, relative to the one that makes the image just fit."""
    return float(np.exp(rng.uniform(*np.log(scale))) * min(np.divide(size, image.rgb.shape[1::-1])))


def regions(count: int, size: tuple[int, int], rng: np.random.Generator) -> list[Region]:
    """All of the canvas, or four parts that meet near its middle."""
    if count == 1:
        return [(0, 0, *size)]
    x, y = (int(extent * rng.uniform(0.3, 0.7)) for extent in size)
    width, height = size
    return [(0, 0, x, y), (x, 0, width, y), (0, y, x, height), (x, y, width, height)]


def place(
    image: LabelledImage,
    canvas: NDArray[np.uint8],
    region: Region,
    ratio: float,
    kept: float,
    rng: np.random.Generator,
) -> LabelledImage:
    """Draw the image, ``ratio`` times as large, somewhere in a region of the canvas; its boxes there."""
    x0, y0, x1, y1 = region
    rows, columns = image.rgb.shape[:2]
    extent = max(1, round(columns * ratio)), max(1, round(rows * ratio))
    how = cv2.INTER_AREA if ratio < 0.5 else cv2.INTER_LINEAR  # as Letterbox.fit
    drawn = cv2.resize(image.rgb, extent, interpolation=how)
    # Where the image is larger than its region a part of it is cut out; else it lies somewhere inside.
    left, top = (
        start + int(rng.integers(min(0, room), max(0, room) + 1))
        for start, room in ((x0, x1 - x0 - extent[0]), (y0, y1 - y0 - extent[1]))
    )
    u0, v0 = max(left, x0), max(top, y0)
    u1, v1 = min(left + extent[0], x1), min(top + extent[1], y1)
    canvas[v0:v1, u0:u1] = drawn[v0 - top : v1 - top, u0 - left : u1 - left]
    factors = np.tile(np.divide(extent, (columns, rows)), 2)
    moved = image.boxes * factors + np.tile([left, top], 2)
    return cut(LabelledImage(canvas, moved.astype(np.float32), image.ignored), (u0, v0, u1, v1), kept)


def cut(image: LabelledImage, region: Region, kept: float) -> LabelledImage:
    """Boxes cut at a region's edges; ignored where less than the share ``kept`` is left, gone where nothing is."""
    low, high = np.tile(region[:2], 2), np.tile(region[2:], 2)
    boxes = np.clip(image.boxes, low, high).astype(np.float32)
    left = areas(boxes)
    ignored = image.ignored | (left < kept * areas(image.boxes))
    return LabelledImage(image.rgb, boxes[left > 0], ignored[left > 0])


def mirrored(image: LabelledImage) -> LabelledImage:
    """Left and right exchanged."""
    width = image.rgb.shape[1]
    boxes = image.boxes.copy()
    boxes[:, [0, 2]] = width - boxes[:, [2, 0]]
    return LabelledImage(np.ascontiguousarray(image.rgb[:, ::-1]), boxes, image.ignored)


def recoloured(image: LabelledImage, config: AugmentationConfig, rng: np.random.Generator) -> LabelledImage:
    """Hue turned, saturation and brightness times random factors."""
    hue = rng.uniform(-config.hue, config.hue) * 180  # half degrees, as OpenCV has hue
    saturation, exposure = (
        np.exp(rng.uniform(-1, 1) * np.log(most)) for most in (config.saturation, config.exposure)
    )
    steps = np.arange(256)
    tables = [
        (steps + hue) % 180,
        np.clip(steps * saturation, 0, 255),
        np.clip(steps * exposure, 0, 255),
    ]
    table = np.stack(tables, axis=1).astype(np.uint8)[None]
    changed = cv2.LUT(cv2.cvtColor(image.rgb, cv2.COLOR_RGB2HSV), table)
    rgb = cv2.cvtColor(changed, cv2.COLOR_HSV2RGB).astype(np.uint8, copy=False)
    return replace(image, rgb=rgb)
