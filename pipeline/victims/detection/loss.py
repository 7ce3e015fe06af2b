"""The loss of a network that detects people.

It is YOLOv3's loss with two changes from its successors: boxes are compared by CIoU (Zheng et al., arXiv:1911.08287)
instead of coordinate by coordinate, and every anchor of about a person's size is assigned to the person, not only the
best one (Bochkovskiy et al., YOLOv4, arXiv:2004.10934, section 3.4).
"""

from collections.abc import Sequence
from math import pi

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits, logsigmoid

from pipeline.victims.detection.boxes import LARGEST_EXPONENT, size_overlaps
from pipeline.victims.detection.labelled_image import TrainingImage
from pipeline.victims.detection.yolo import OBJECTNESS, Grid

ASSIGNED_IOU = 0.3  # Minimum overlap of an anchor's size with a person's for the anchor to be assigned to the person
IGNORED_IOU = 0.7
"""Minimum overlap of a predicted box with a person's for its objectness not to be penalized, like Darknet's
``ignore_thresh``."""
TINY = torch.finfo(torch.float32).eps  # Lower limit of divisors, because areas and lengths of boxes may be 0

Index = tuple[Tensor, ...]
"""Four (P,) int64 tensors: image in the batch, anchor in the scale's mask, row and column of the cell."""


class YoloLoss:
    """The loss of a network with one class: a detector of people.

    Attributes:
        grids: the network's grids.
        size: width and height of the network's input, pixels.
    """

    def __init__(self, grids: Sequence[Grid], size: tuple[int, int]) -> None:
        self.grids, self.size = grids, size

    def __call__(self, heads: Sequence[Tensor], batch: Sequence[TrainingImage]) -> Tensor:
        """() sum of box, objectness and class losses per assigned anchor, from heads (N, anchors · NUMBERS, H, W)."""
        boxes = objectness = classes = heads[0].new_zeros(())
        asked = 0
        for head, grid in zip(heads, self.grids, strict=True):
            cells = head.float().unflatten(1, (len(grid.mask), -1)).movedim(2, -1)
            index, truths = self._targets(batch, grid, *head.shape[2:])
            predicted = self._boxes(cells, grid)
            boxes = boxes + (1 - ciou(predicted[index], truths)).sum()
            objectness = objectness + self._objectness(cells, predicted.detach(), index, batch)
            classes = classes - logsigmoid(cells[..., OBJECTNESS + 1][index]).sum()  # the only class is person
            asked += len(truths)
        return (boxes + objectness + classes) / max(1, asked)

    def _objectness(self, cells: Tensor, predicted: Tensor, index: Index, batch: Sequence[TrainingImage]) -> Tensor:
        """Cross-entropy of the objectness over all cells except those near a person but not assigned to one."""
        wanted = torch.zeros_like(cells[..., OBJECTNESS])
        wanted[index] = 1
        counted = torch.stack([self._far(boxes, image) for boxes, image in zip(predicted, batch, strict=True)])
        counted[index] = True
        return binary_cross_entropy_with_logits(cells[..., OBJECTNESS][counted], wanted[counted], reduction="sum")

    def _far(self, predicted: Tensor, image: TrainingImage) -> Tensor:
        """(anchors, H, W) bool: boxes that overlap no person by IGNORED_IOU, with a middle in no ignored person."""
        far = torch.ones(predicted.shape[:-1], dtype=torch.bool, device=predicted.device)
        middle = (predicted[..., :2] + predicted[..., 2:]) / 2
        for box, ignored in zip(torch.from_numpy(image.boxes).to(far.device), image.ignored, strict=True):
            if ignored:
                far &= ~((middle >= box[:2]) & (middle <= box[2:])).all(dim=-1)
            far &= iou(predicted, box) < IGNORED_IOU
        return far

    def _targets(self, batch: Sequence[TrainingImage], grid: Grid, rows: int, columns: int) -> tuple[Index, Tensor]:
        """Cells of one scale that are assigned to people, and these people's (P, 4) boxes in the input, pixels."""
        anchors = np.array(grid.anchors)
        parts = [np.zeros((0, 2), int)]
        boxes = [np.zeros((0, 4), np.float32)]
        for number, image in enumerate(batch):
            seen = image.boxes[~image.ignored]
            person, anchor = self._asked(seen, anchors, grid.mask)
            parts.append(np.stack([np.full(len(person), number), anchor], axis=1))
            boxes.append(seen[person])
        all_boxes = np.concatenate(boxes)
        middle = (all_boxes[:, :2] + all_boxes[:, 2:]) / 2
        cell = middle * np.divide((columns, rows), self.size)
        column, row = np.minimum(cell.astype(int), (columns - 1, rows - 1)).T
        image_number, anchor = np.concatenate(parts).T
        index = tuple(torch.from_numpy(numbers) for numbers in (image_number, anchor, row, column))
        return index, torch.from_numpy(all_boxes)

    def _asked(
        self, boxes: NDArray[np.float32], anchors: NDArray[np.float64], mask: tuple[int, ...]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Pairs of a person and an assigned anchor of the mask: the best one, and all of about the person's size."""
        overlap = size_overlaps(boxes[:, 2:] - boxes[:, :2], anchors)
        asked = overlap >= ASSIGNED_IOU
        if len(boxes):
            asked[np.arange(len(boxes)), overlap.argmax(axis=1)] = True
        person, anchor = np.nonzero(asked[:, list(mask)])
        return person, anchor

    def _boxes(self, cells: Tensor, grid: Grid) -> Tensor:
        """(N, anchors, H, W, 4) boxes in the input, pixels, decoded as by :func:`.boxes.decode`."""
        rows, columns = cells.shape[2:4]
        y, x = torch.meshgrid(torch.arange(rows), torch.arange(columns), indexing="ij")
        stride = torch.tensor([self.size[0] / columns, self.size[1] / rows], device=cells.device)
        middle = (cells[..., :2].sigmoid() + torch.stack([x, y], dim=-1).to(cells.device)) * stride
        sizes = torch.tensor(grid.anchors, device=cells.device)[list(grid.mask)][None, :, None, None]
        half = cells[..., 2:OBJECTNESS].clamp(max=LARGEST_EXPONENT).exp() * sizes / 2
        return torch.cat([middle - half, middle + half], dim=-1)


def iou(a: Tensor, b: Tensor) -> Tensor:
    """(...) intersection over union of pairs of (..., 4) boxes."""
    common = (torch.minimum(a[..., 2:], b[..., 2:]) - torch.maximum(a[..., :2], b[..., :2])).clamp(min=0)
    inter = common.prod(dim=-1)
    union = (a[..., 2:] - a[..., :2]).prod(dim=-1) + (b[..., 2:] - b[..., :2]).prod(dim=-1) - inter
    return inter / union.clamp(min=TINY)


def ciou(a: Tensor, b: Tensor) -> Tensor:
    """(P,) complete IoU of pairs of (P, 4) boxes: IoU minus penalties for distant middles and unlike shapes."""
    hull = torch.maximum(a[:, 2:], b[:, 2:]) - torch.minimum(a[:, :2], b[:, :2])
    apart = ((a[:, :2] + a[:, 2:] - b[:, :2] - b[:, 2:]) / 2).square().sum(dim=1)
    overlap = iou(a, b)
    angles = [torch.atan2(*(box[:, 2:] - box[:, :2]).clamp(min=TINY).unbind(dim=1)) for box in (a, b)]
    shape = (2 / pi * (angles[0] - angles[1])).square()
    with torch.no_grad():
        weight = shape / (1 - overlap + shape).clamp(min=TINY)
    return overlap - apart / hull.square().sum(dim=1).clamp(min=TINY) - weight * shape
