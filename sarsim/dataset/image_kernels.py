"""Compiled loops over the pixels of a frame."""

import numpy as np
from numba import njit


@njit(cache=True)
def victim_boxes(instance, victim_of_geom, boxes, areas):
    """Find the bounding box and the number of visible pixels of each victim.

    Args:
        instance: (H, W) int32 geom ids, -1 = none.
        victim_of_geom: (G,) int16 index of the victim to which each geom belongs, -1 = none.
        boxes: (V, 4) int32, output: first column and row, last column and row + 1; unchanged for victims out of view.
        areas: (V,) int32, initially 0; output: the number of pixels that show each victim.
    """
    for v in range(instance.shape[0]):
        for u in range(instance.shape[1]):
            geom = instance[v, u]
            victim = victim_of_geom[geom] if geom >= 0 else -1
            if victim >= 0:
                box = boxes[victim]
                if areas[victim] == 0:
                    box[0], box[1], box[2], box[3] = u, v, u + 1, v + 1
                box[0], box[2], box[3] = min(box[0], u), max(box[2], u + 1), v + 1
                areas[victim] += 1


@njit(cache=True)
def to_millimetres(depth, label, millimetres, label_points):
    """Round depth to millimetres, and count the returns of each label.

    Args:
        depth: (H, W) float32 m, 0 = no return.
        label: (H, W) uint8 labels.
        millimetres: (H, W) uint16, output: depth, mm.
        label_points: (L,) int64; each return adds 1 to the count of its label.
    """
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            millimetres[v, u] = np.uint16(np.rint(depth[v, u] * np.float32(1000)))
            label_points[label[v, u]] += depth[v, u] > 0
