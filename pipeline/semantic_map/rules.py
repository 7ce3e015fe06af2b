"""The baseline: classes by height and slope alone, without learning."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.frame import Frame
from pipeline.labels import RAMP_TILT, Label
from pipeline.semantic_map.voxels import VoxelCloud

PATCH_POINTS = 30  # Points to which a normal is fitted
WALL_TILT = np.radians(60)  # rad; a surface at least as steep is a wall
CLOUD_VOXEL = 0.03  # m; the cloud is thinned to one point a voxel, and a surface that is rougher is clutter
DECK_HEIGHT = 0.08  # m; a level surface above this is a straight ramp, not terrain
CEILING_HEIGHT = 2.0  # m; a level surface above this is a ceiling


class RuleClassifier:
    """Classifies points by height and normal; a :class:`pipeline.semantic_map.classifier.PointClassifier`."""

    def classify(
        self, frame: Frame, points: NDArray[np.float32], T_map_camera: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """(N, 8) float32 one-hot; a point that is not finite is unlabelled."""
        cloud = VoxelCloud.of(points, CLOUD_VOXEL)
        labels = np.append(_labels(cloud.points), Label.UNLABELLED)
        return np.eye(len(Label), dtype=np.float32)[labels[cloud.voxel_of_point]]


def _labels(points: NDArray[np.float32]) -> NDArray[np.int64]:
    """(M,) labels of (M, 3) points."""
    tilt, roughness = tilt_and_roughness(points, PATCH_POINTS)
    # The first rule that holds decides.
    rules = [
        (tilt > WALL_TILT, Label.WALL),
        (roughness > CLOUD_VOXEL, Label.CLUTTER),
        (tilt >= RAMP_TILT, Label.INCLINED_RAMP),
        (points[:, 2] > CEILING_HEIGHT, Label.CEILING),
        (points[:, 2] > DECK_HEIGHT, Label.STRAIGHT_RAMP),
    ]
    return np.select([rule for rule, _ in rules], [label for _, label in rules], Label.TERRAIN)


def tilt_and_roughness(
    points: NDArray[np.float32], neighbours: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Tilt of, and deviation from, the plane fitted to the nearest points of every point by principal components.

    Args:
        points: (M, 3) float32.
        neighbours: number of nearest points, the point itself included; all points if there are fewer.

    Returns:
        (M,) angle between the plane's normal and the vertical, 0 to π/2, and (M,) standard deviation from the plane
        in metres.
    """
    if len(points) == 0:
        return np.empty(0), np.empty(0)
    nearest = cKDTree(points).query(points, range(1, 1 + min(neighbours, len(points))))[1]
    patches = points[nearest].astype(np.float64)
    patches -= patches.mean(axis=1, keepdims=True)
    variances, axes = np.linalg.eigh(np.einsum("mki,mkj->mij", patches, patches) / nearest.shape[1])
    return np.arccos(np.abs(axes[:, 2, 0]).clip(0, 1)), np.sqrt(variances[:, 0].clip(min=0))
