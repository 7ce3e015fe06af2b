"""The shipped detector of people: the arena network finds candidates, which the COCO network must corroborate.

The arena network (YOLOv3-small) was trained only on renderings of arenas: it misses few people there, but has many
false detections in photos. The COCO network (YOLOv3-tiny) was trained on photos: it is seldom wrong, but costs four
times as much per pixel. The COCO network therefore examines only candidates, unless the image does not look like an
arena.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Mask, Rgb
from pipeline.tracks.find import VICTIM
from pipeline.victims.boxes import ScoredBoxes, joined, pairwise_iou, suppress_non_maxima
from pipeline.victims.config import DetectorConfig
from pipeline.victims.yolo import Yolo, load_shipped

NEAR_SIZE = 224, 160
"""Size of a second, smaller input, pixels, for people so near that they are too large in the first input."""
LARGE_BOX = 0.15
"""Minimum longer side of a box found in the second input, relative to the image's longer side."""
MIN_HINT_CONFIDENCE = 0.02
"""Minimum confidence of a box that is a hint of a person."""
CORROBORATION_IOU = 0.3
"""Minimum intersection over union, exclusive, of a candidate's box and a box that corroborates it."""
CLOSE_UP_SIZE = 128, 128
"""Size of the COCO network's input for a candidate, pixels, multiples of 32."""
CONTEXT = 1.25
"""Side of the square around a candidate that this input shows, relative to the candidate's longer side."""
MIN_LYING_RATIO = 0.8
"""Minimum ratio of a candidate's width to its height for its square to be rotated, because few photos show people
lying."""
NOTHING: ScoredBoxes = np.zeros((0, 4), np.float32), np.zeros((0, 1), np.float32)


class TwoStageNetwork:
    """Finds people whom both networks see, and people of whom the COCO network alone is certain enough."""

    kinds: ClassVar[dict[str, list[int]]] = {VICTIM: [0]}

    def __init__(self, arena: Yolo, coco: Yolo, config: DetectorConfig) -> None:
        """``arena``: the network that finds candidates; ``coco``: the network that must corroborate them."""
        self._arena = arena
        self._coco = coco
        self._config = config

    @classmethod
    def load(cls, weights: Path, config: DetectorConfig) -> Self:
        """A detector with the weights of a file; InputError as for :func:`load_shipped`."""
        return cls(*load_shipped(weights), config)

    def find(self, image: Rgb, min_confidence: float) -> ScoredBoxes:
        """Boxes of people in an image, and their (N, 1) confidences, some of which are below ``min_confidence``."""
        (boxes, scores), hints = self._candidates(image, min_confidence)
        look = self._check_close_ups if hints <= self._config.max_hints else self._check_whole_image
        corroborated, seen = look(image, boxes)
        return joined([(boxes[corroborated], scores[corroborated]), seen])

    def _candidates(self, image: Rgb, min_confidence: float) -> tuple[ScoredBoxes, int]:
        """The candidates of the arena network, the most confident first, and the number of hints of people."""
        config = self._config
        far = self._arena.boxes(image, config.size, min(MIN_HINT_CONFIDENCE, min_confidence))
        hints = len(self._best(far, MIN_HINT_CONFIDENCE)[0])
        parts = [far, self._near_boxes(self._arena, image, min_confidence)] if hints else [NOTHING]
        return self._best(joined(parts), min_confidence), hints

    def _near_boxes(self, network: Yolo, image: Rgb, min_confidence: float) -> ScoredBoxes:
        """Boxes of people who are so near that they are too large for a network at the usual size of the input."""
        boxes, scores = network.boxes(image, NEAR_SIZE, min_confidence)
        extent = np.max(boxes[:, 2:] - boxes[:, :2], axis=1, initial=0)
        is_near = extent >= LARGE_BOX * max(image.shape)
        return boxes[is_near], scores[is_near]

    def _check_close_ups(self, image: Rgb, candidates: NDArray[np.float32]) -> tuple[Mask, ScoredBoxes]:
        """(N,) whether each of (N, 4) candidates is corroborated in a square around it, and the squares' boxes."""
        seen, corroborated = NOTHING, np.zeros(len(candidates), bool)
        for number, candidate in enumerate(candidates[:, None]):
            corroborated[number] = self._are_corroborated(candidate, seen)
            if not corroborated[number]:
                corner, square = surroundings(image, candidate[0])
                # A candidate nearly fills its square; people this large are found on the coarsest grid.
                view = shifted(
                    self._coco.boxes(square, CLOSE_UP_SIZE, self._config.min_corroboration, heads=1), corner
                )
                seen = joined([seen, view])
                corroborated[number] = self._are_corroborated(candidate, view) or (
                    _is_wide(candidate[0])
                    and self._are_corroborated(candidate, shifted(self._rotated_boxes(square), corner))
                )
        return corroborated, seen

    def _check_whole_image(self, image: Rgb, candidates: NDArray[np.float32]) -> tuple[Mask, ScoredBoxes]:
        """(N,) whether each of (N, 4) candidates is corroborated in the whole image, and all boxes in the image."""
        least = self._config.min_corroboration
        seen = joined([self._coco.boxes(image, self._config.size, least), self._near_boxes(self._coco, image, least)])
        return self._are_corroborated(candidates, seen), seen

    def _rotated_boxes(self, image: Rgb) -> ScoredBoxes:
        """Boxes that the COCO network sees in an image rotated by 90° either way, which sets lying people upright."""
        sides = ((turns, np.rot90(image, turns)) for turns in (1, -1))
        return joined(
            (rotated_back(boxes, turns, image.shape), scores)
            for turns, side in sides
            for boxes, scores in [self._coco.boxes(side, CLOSE_UP_SIZE, self._config.min_corroboration, heads=1)]
        )

    def _are_corroborated(self, candidates: NDArray[np.float32], seen: ScoredBoxes) -> Mask:
        """(N,) whether each of (N, 4) candidates overlaps a seen box, with an IoU above ``CORROBORATION_IOU``."""
        boxes, _ = self._best(seen, self._config.min_corroboration)
        return np.asarray(pairwise_iou(candidates, boxes).max(axis=1, initial=0) > CORROBORATION_IOU)

    def _best(self, found: ScoredBoxes, min_confidence: float) -> ScoredBoxes:
        """One box per object, the most confident first."""
        boxes, scores = suppress_non_maxima(found[0], found[1][:, 0], min_confidence, self._config.suppressing_iou)
        return boxes, scores[:, None]


def surroundings(image: Rgb, box: NDArray[np.float32]) -> tuple[NDArray[np.float32], Rgb]:
    """The upper left corner, pixels, and the content of a square around a box.

    The square is ``CONTEXT`` times as wide as the box's longer side.
    """
    middle, half = (box[:2] + box[2:]) / 2, CONTEXT * np.max(box[2:] - box[:2]) / 2
    size = image.shape[1::-1]
    x0, y0 = np.clip(np.floor(middle - half), 0, size).astype(int)
    x1, y1 = np.clip(np.ceil(middle + half), 0, size).astype(int)
    return np.array([x0, y0], np.float32), image[y0:y1, x0:x1]


def shifted(found: ScoredBoxes, corner: NDArray[np.float32]) -> ScoredBoxes:
    """Boxes in an image, from boxes in a part of the image whose upper left corner is ``corner`` (2,), pixels."""
    return found[0] + np.tile(corner, 2), found[1]


def rotated_back(boxes: NDArray[np.float32], turns: int, shape: Sequence[int]) -> NDArray[np.float32]:
    """(N, 4) boxes in an image of ``shape`` (H, W, 3), from boxes in the same image rotated by 90°.

    ``turns``: 1 if the image was rotated to the left, −1 if to the right.
    """
    height, width, _ = shape
    x0, y0, x1, y1 = boxes.T
    return np.stack([width - y1, x0, width - y0, x1] if turns > 0 else [y0, height - x1, y1, height - x0], axis=1)


def _is_wide(box: NDArray[np.float32]) -> bool:
    width, height = box[2:] - box[:2]
    return bool(width >= MIN_LYING_RATIO * height)
