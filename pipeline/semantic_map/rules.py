"""The baseline: classification by height, slope and roughness, without learning."""

import numpy as np
from scipy.spatial import cKDTree

from pipeline.arrays import Indices, Points, Pose, Probabilities, Values
from pipeline.frame import Frame
from pipeline.geometry.thinning import VoxelCloud
from pipeline.labels import RAMP_TILT, Label
from pipeline.semantic_map.classifier import PointClassifier
from pipeline.semantic_map.config import RuleConfig

VOXEL = 0.03
"""Edge length of a voxel, m; the cloud is thinned to one point per voxel."""
NEIGHBOURS = 30
"""Number of points to which a plane is fitted for the normal."""
ROUGHNESS = 0.03
"""Maximum standard deviation of the neighbours from their plane, m; rougher surfaces are clutter."""


class RuleClassifier(PointClassifier):
    """Classifies points by height and normal."""

    def __init__(self, *, config: RuleConfig = RuleConfig()) -> None:
        """Classify with the rules' parameters ``config``."""
        self._config = config

    def classify(self, frame: Frame, points: Points, T_map_camera: Pose) -> Probabilities:
        """One-hot probabilities; points that are not finite are unlabelled."""
        cloud = VoxelCloud.of(points, VOXEL)
        labels = np.append(_labels(cloud.points, self._config), Label.UNLABELLED)
        return np.eye(len(Label), dtype=np.float32)[labels[cloud.voxel_of_point]]


def _labels(points: Points, config: RuleConfig) -> Indices:
    tilt, roughness = tilt_and_roughness(points, NEIGHBOURS)
    # The first rule that applies decides.
    rules = [
        (tilt > config.wall_tilt, Label.WALL),
        (roughness > ROUGHNESS, Label.CLUTTER),
        (tilt >= RAMP_TILT, Label.INCLINED_RAMP),
        (points[:, 2] > config.min_ceiling_height, Label.CEILING),
        (points[:, 2] > config.min_deck_height, Label.STRAIGHT_RAMP),
    ]
    return np.select([rule for rule, _ in rules], [label for _, label in rules], Label.TERRAIN)


def tilt_and_roughness(points: Points, neighbours: int) -> tuple[Values, Values]:
    """Tilt and roughness of the surface around every point, from principal components of its nearest points.

    Args:
        points: points of surfaces.
        neighbours: number of nearest points, the point itself included; all points if there are fewer.

    Returns:
        Angle between the fitted plane's normal and the vertical, 0 to π/2 rad, and standard deviation of the nearest
        points from this plane, m.
    """
    if len(points) == 0:
        return np.empty(0), np.empty(0)
    nearest = cKDTree(points).query(points, range(1, 1 + min(neighbours, len(points))))[1]
    patches = points[nearest].astype(np.float64)
    patches -= patches.mean(axis=1, keepdims=True)
    variances, axes = np.linalg.eigh(np.einsum("mki,mkj->mij", patches, patches) / nearest.shape[1])
    return np.arccos(np.abs(axes[:, 2, 0]).clip(0, 1)), np.sqrt(variances[:, 0].clip(min=0))
