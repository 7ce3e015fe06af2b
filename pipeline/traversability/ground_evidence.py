"""Evidence of the ground, relative to the robot's pose at that moment, so that it follows corrections of the pose."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.segments.cells_kernels import moved
from pipeline.semantic_map.voxels import VoxelCloud
from pipeline.traversability.depth_dropouts import find_depth_dropouts
from pipeline.traversability.elevation_map import CELL, ElevationMap


@dataclass(frozen=True, eq=False)
class Seen:
    """The returns of a keyframe, thinned.

    Attributes:
        points: (N, 3) float32 in ``base_link``, m.
        hits: (N,) uint32, number of returns that each point is the mean of.
        dropouts: (M, 3) float32 in ``base_link``, m, where ground should have been seen.
        dropout_hits: (M,) uint32, number of pixels that each dropout is the mean of.
        T_base_camera: 4×4.
    """

    points: NDArray[np.float32]
    hits: NDArray[np.uint32]
    dropouts: NDArray[np.float32]
    dropout_hits: NDArray[np.uint32]
    T_base_camera: NDArray[np.float64]

    @classmethod
    def of(cls, frame: Frame, cloud: VoxelCloud) -> "Seen":
        """What a frame shows; ``cloud``: its returns in ``base_link``, thinned."""
        dropouts = find_depth_dropouts(frame.depth, frame.intrinsics, frame.T_base_camera)
        missing = VoxelCloud.of(dropouts, CELL / 2)
        return cls(cloud.points, cloud.hits, missing.points, missing.hits, frame.T_base_camera)

    def put(self, elevation_map: ElevationMap, T_map_base: NDArray[np.float64]) -> None:
        """Add the returns and the dropouts, seen from the 4×4 pose ``T_map_base``, where the robot can stand."""
        points, dropouts = moved(T_map_base, self.points), moved(T_map_base, self.dropouts)
        camera = (T_map_base @ self.T_base_camera)[:3, 3]
        elevation_map.update(points, dropouts, camera, self.hits, self.dropout_hits)
        elevation_map.add_track(T_map_base[None, :2, 3])


@dataclass(frozen=True, eq=False)
class Assumed:
    """Ground that is taken for flat where the robot was set down.

    Attributes:
        T_base_start: 4×4 pose at which the robot was set down.
        radius, ahead, width: m, see :meth:`ElevationMap.assume_ground`.
    """

    T_base_start: NDArray[np.float64]
    radius: float
    ahead: float
    width: float

    def put(self, elevation_map: ElevationMap, T_map_base: NDArray[np.float64]) -> None:
        """Assume the ground, relative to the 4×4 pose ``T_map_base``."""
        elevation_map.assume_ground(T_map_base @ self.T_base_start, self.radius, self.ahead, self.width)


@dataclass(frozen=True, eq=False)
class Driven:
    """What a drive has shown near a keyframe, m in its ``base_link``.

    Attributes:
        track: (N, 3) float32 positions of the robot's middle.
        obstacles: (M, 3) float32 points of what stood in its way.
        touched: (K, 3) float32 points that the robot touched.
    """

    track: NDArray[np.float32]
    obstacles: NDArray[np.float32]
    touched: NDArray[np.float32]

    def put(self, elevation_map: ElevationMap, T_map_base: NDArray[np.float64]) -> None:
        """Add track, obstacles and contacts, relative to the 4×4 pose ``T_map_base``."""
        track, obstacles, touched = (moved(T_map_base, p) for p in (self.track, self.obstacles, self.touched))
        elevation_map.update(obstacles)
        elevation_map.add_track(track[:, :2])
        if len(touched):
            elevation_map.add_obstacle(touched)


GroundEvidence = Seen | Assumed | Driven
"""Something from which an elevation map is made: ``put`` puts it into the map for a robot at a 4×4 pose."""
