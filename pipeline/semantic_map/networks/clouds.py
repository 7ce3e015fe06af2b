"""Labelled frames as clouds for training and validation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Indices, Place, Pose
from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.geometry.thinning import VoxelCloud
from pipeline.semantic_map.classifier import CLASSES
from pipeline.semantic_map.networks.blocks import CLASS_OF_LABEL, coloured


@dataclass(frozen=True, eq=False)
class LabelledCloud:
    """The labelled returns of a frame, thinned to one point per voxel.

    Attributes:
        points: (M, 3) float32 in ``map``, or (M, 6) with their colours.
        counts: (M, 6) uint16 number of returns of each class in the voxel of each point.
        camera: position of the camera.
    """

    points: NDArray[np.float32]
    counts: NDArray[np.uint16]
    camera: Place

    @classmethod
    def of(cls, frame: Frame, T_map_camera: Pose, voxel_size: float, colours: bool = False) -> "LabelledCloud":
        """The cloud of a frame with true labels, without unlabelled returns. With ``colours``, points are (M, 6).

        Raises:
            InputError: the frame has no labels.
        """
        if frame.label is None:
            raise InputError(
                f"the frame at {frame.time:.2f} s has no true labels to learn from; use scenes made by sarsim-dataset"
            )
        classes = CLASS_OF_LABEL[frame.label[frame.returns]]
        has_class = classes >= 0
        cloud = VoxelCloud.of(frame.points(T_map_camera)[has_class], voxel_size)
        cells = cloud.voxel_of_point * len(CLASSES) + classes[has_class]
        size = (len(cloud.points) + 1) * len(CLASSES)  # the last row has the returns without a voxel
        counts = np.bincount(cells, minlength=size).reshape(-1, len(CLASSES))[:-1]
        points = coloured(cloud, frame.rgb[frame.returns][has_class]) if colours else cloud.points
        return cls(points, counts.clip(max=np.iinfo(np.uint16).max).astype(np.uint16), T_map_camera[:3, 3])

    @property
    def classes(self) -> Indices:
        """The most frequent class in every point's voxel."""
        return self.counts.argmax(axis=1)
