"""Labelled point clouds of a scene."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Labels, Points
from pipeline.errors import required
from pipeline.geometry.thinning import first_in_voxels
from sarsim.dataset.scene_file import Scene


@dataclass(frozen=True, eq=False)
class Cloud:
    """Labelled points in the world frame.

    Attributes:
        points: (N, 3) float32 m.
        rgb: (N, 3) uint8.
        label: (N,) uint8.
        instance: (N,) int32 geom ids, -1 = none.
    """

    points: Points
    rgb: NDArray[np.uint8]
    label: Labels
    instance: NDArray[np.int32]

    @classmethod
    def of_frame(cls, scene: Scene, index: int) -> Self:
        """All returns of a frame, placed with the true pose."""
        frame = scene.frame(index)
        seen = frame.returns
        points = frame.points(scene.T_world_camera(index))
        return cls(points, frame.rgb[seen], required(frame.label)[seen], required(frame.instance)[seen])

    @classmethod
    def of_scene(cls, scene: Scene, voxel: float) -> Self:
        """The returns of all frames, thinned to one in each cube with sides of ``voxel`` m."""
        parts = [cls.of_frame(scene, index).thinned(voxel) for index in range(len(scene))]
        columns = zip(*(vars(part).values() for part in parts), strict=True)
        return cls(*map(np.concatenate, columns)).thinned(voxel)

    def thinned(self, voxel: float) -> Self:
        """The first point in every cube with sides of ``voxel`` m."""
        return self.of(first_in_voxels(self.points.astype(np.float64) / voxel))

    def of(self, chosen: NDArray) -> Self:
        """The points selected by indices or a mask."""
        return type(self)(*(column[chosen] for column in vars(self).values()))
