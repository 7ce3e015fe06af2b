"""Training canvases: one frame or a mosaic of four, randomly scaled, placed, mirrored and recoloured.

Onto some canvases, the people of another frame are pasted (Ghiasi et al., arXiv:2012.07177).
"""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.errors import InputError
from pipeline.victims.config import ExposureConfig
from pipeline.victims.detection.boxes import areas
from pipeline.victims.detection.input_image import GREY, evenly_exposed, scaled
from pipeline.victims.detection.labelled_image import TrainingImage, TrainingImages
from pipeline.victims.detection.training_config import CanvasAugmentation, YoloTrainingConfig

Region = tuple[int, int, int, int]  # x0, y0, x1, y1 in the canvas, pixels


class CanvasSampler:
    """Draws random canvases; each depends only on its number and the seed."""

    def __init__(self, images: TrainingImages, config: YoloTrainingConfig) -> None:
        """Draw from ``images``.

        Raises:
            InputError: no image shows people.
        """
        self._images, self._config, self._odds = images, config, config.augmentation.odds
        shown = np.array([len(images.people(index)) > 0 for index in range(len(images))], bool)
        self._shown, self._empty = np.flatnonzero(shown), np.flatnonzero(~shown)
        if len(self._shown) == 0:
            raise InputError("no training image shows a person; choose datasets that contain victims with --data")

    def batch(self, number: int) -> list[TrainingImage]:
        """Batch ``number`` of the training."""
        return [self._canvas(number * self._config.batch + i) for i in range(self._config.batch)]

    def _canvas(self, number: int) -> TrainingImage:
        rng = np.random.default_rng([self._config.seed, number])
        count = 4 if rng.random() < self._odds else 1
        images = [self._image(self._draw(rng)) for _ in range(count)]
        pasted = [rng.choice(self._shown)] if rng.random() < self._odds else []
        donors = [self._image(int(index)) for index in pasted]
        size = self._config.width, self._config.height
        return augmented(images, donors, size, self._config.augmentation, rng)

    def _image(self, index: int) -> TrainingImage:
        """An image with uneven lighting compensated, as the detector passes it to the network."""
        image = self._images[index]
        return replace(image, rgb=evenly_exposed(image.rgb, ExposureConfig()))

    def _draw(self, rng: np.random.Generator) -> int:
        empty = len(self._empty) > 0 and rng.random() < self._odds
        return int(rng.choice(self._empty if empty else self._shown))


def augmented(
    images: Sequence[TrainingImage],
    donors: Sequence[TrainingImage],
    size: tuple[int, int],
    config: CanvasAugmentation,
    rng: np.random.Generator,
) -> TrainingImage:
    """A canvas of ``size`` (width, height) with one image or four, and the donors' people pasted onto it."""
    canvas = np.full((size[1], size[0], 3), GREY, np.uint8)
    boxes, ignored = [np.zeros((0, 4), np.float32)], [np.zeros(0, bool)]
    for image, region in zip(images, regions(len(images), size, rng), strict=True):
        ratio = _ratio(image, np.subtract(region[2:], region[:2]), config, rng)
        placed = place(recoloured(image, config, rng), canvas, region, ratio, config, rng)
        boxes.append(placed.boxes)
        ignored.append(placed.ignored)
    whole = TrainingImage(canvas, np.concatenate(boxes), np.concatenate(ignored))
    for donor in donors:
        whole = pasted(whole, recoloured(donor, config, rng), _ratio(donor, size, config, rng), config, rng)
    return mirrored(whole) if rng.random() < config.odds else whole


def _factor(config: CanvasAugmentation, rng: np.random.Generator) -> float:
    """A random factor between 1 / variation and variation."""
    return float(config.variation ** rng.uniform(-1, 1))


def _ratio(image: TrainingImage, room: ArrayLike, config: CanvasAugmentation, rng: np.random.Generator) -> float:
    """A random scale for an image, around the scale at which it just fits into ``room`` (2,), pixels."""
    return _factor(config, rng) * float(min(np.divide(room, image.rgb.shape[1::-1])))


def regions(count: int, size: tuple[int, int], rng: np.random.Generator) -> list[Region]:
    """The whole canvas for one image; for four images, four parts that meet at a random point near the middle."""
    if count == 1:
        return [(0, 0, *size)]
    x, y = (int(rng.uniform(extent / 3, 2 * extent / 3)) for extent in size)
    width, height = size
    return [(0, 0, x, y), (x, 0, width, y), (0, y, x, height), (x, y, width, height)]


def place(
    image: TrainingImage,
    canvas: NDArray[np.uint8],
    region: Region,
    ratio: float,
    config: CanvasAugmentation,
    rng: np.random.Generator,
) -> TrainingImage:
    """Draw an image, scaled by ``ratio``, somewhere in a region of a canvas (H, W, 3); returns its boxes there."""
    x0, y0, x1, y1 = region
    drawn = scaled(image.rgb, ratio)
    rows, columns = drawn.shape[:2]
    # An image larger than its region is cropped at random; a smaller one is placed at random.
    left, top = (
        start + int(rng.integers(min(0, room), max(0, room) + 1))
        for start, room in ((x0, x1 - x0 - columns), (y0, y1 - y0 - rows))
    )
    u0, v0 = max(left, x0), max(top, y0)
    u1, v1 = min(left + columns, x1), min(top + rows, y1)
    canvas[v0:v1, u0:u1] = drawn[v0 - top : v1 - top, u0 - left : u1 - left]
    factors = np.tile(np.divide((columns, rows), image.rgb.shape[1::-1]), 2)
    moved = image.boxes * factors + np.tile([left, top], 2)
    return cut(TrainingImage(canvas, moved.astype(np.float32), image.ignored), (u0, v0, u1, v1), config.visible)


def cut(image: TrainingImage, region: Region, visible: float) -> TrainingImage:
    """The image with its boxes clipped to a region; a box is ignored if less than a share of ``visible`` is left."""
    low, high = np.tile(region[:2], 2), np.tile(region[2:], 2)
    boxes = np.clip(image.boxes, low, high).astype(np.float32)
    left = areas(boxes)
    ignored = image.ignored | (left < visible * areas(image.boxes))
    return TrainingImage(image.rgb, boxes[left > 0], ignored[left > 0])


def mirrored(image: TrainingImage) -> TrainingImage:
    """The image with left and right exchanged."""
    width = image.rgb.shape[1]
    boxes = image.boxes.copy()
    boxes[:, [0, 2]] = width - boxes[:, [2, 0]]
    return TrainingImage(np.ascontiguousarray(image.rgb[:, ::-1]), boxes, image.ignored)


def recoloured(image: TrainingImage, config: CanvasAugmentation, rng: np.random.Generator) -> TrainingImage:
    """The image with its hue shifted at random, and its saturation and brightness multiplied by random factors."""
    hsv = cv2.cvtColor(image.rgb, cv2.COLOR_RGB2HSV_FULL)
    hsv[..., 0] += rng.integers(-config.hue, config.hue, endpoint=True).astype(
        np.uint8
    )  # the circle of hues wraps around as uint8 does
    changed = cv2.multiply(hsv, np.array([1, _factor(config, rng), _factor(config, rng), 1]))
    return replace(image, rgb=np.asarray(cv2.cvtColor(changed, cv2.COLOR_HSV2RGB_FULL), np.uint8))


def pasted(
    canvas: TrainingImage, donor: TrainingImage, ratio: float, config: CanvasAugmentation, rng: np.random.Generator
) -> TrainingImage:
    """The canvas with the donor's people, scaled by ``ratio``, at a random position; unchanged if they do not fit.

    Their edges are hard, like those that the renderer draws.
    """
    if donor.shown is None or len(donor.boxes) == 0:
        return canvas
    x0, y0 = np.floor(donor.boxes[:, :2].min(axis=0)).astype(int)
    x1, y1 = np.ceil(donor.boxes[:, 2:].max(axis=0)).astype(int)
    width, height = max(1, round((x1 - x0) * ratio)), max(1, round((y1 - y0) * ratio))
    rows, columns = canvas.rgb.shape[:2]
    if width > columns or height > rows:
        return canvas
    left, top = int(rng.integers(columns - width + 1)), int(rng.integers(rows - height + 1))
    shown = donor.shown[y0:y1, x0:x1].astype(np.uint8)
    cut_out = cv2.resize(shown, (width, height), interpolation=cv2.INTER_NEAREST) > 0
    people = cv2.resize(donor.rgb[y0:y1, x0:x1], (width, height))
    rgb, over = canvas.rgb.copy(), np.zeros((rows, columns), np.bool_)
    over[top : top + height, left : left + width] = cut_out
    rgb[over] = people[cut_out]
    factors = np.tile([width / (x1 - x0), height / (y1 - y0)], 2)
    moved = (donor.boxes - np.tile([x0, y0], 2)) * factors + np.tile([left, top], 2)
    hidden = np.array([_covered(over, box) > 1 - config.visible for box in canvas.boxes], np.bool_)
    return TrainingImage(
        rgb,
        np.concatenate([canvas.boxes, moved]).astype(np.float32),
        np.concatenate([canvas.ignored | hidden, donor.ignored]),
    )


def _covered(over: NDArray[np.bool_], box: NDArray[np.float32]) -> float:
    """Share of a box's pixels that are covered."""
    x0, y0, x1, y1 = box.round().astype(int)
    inside = over[y0:y1, x0:x1]
    return float(inside.mean()) if inside.size else 0.0
