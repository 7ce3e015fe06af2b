"""The points of a plane vote on their classes.

A network that sees only one column of points makes scattered errors, especially at edges, where a voxel contains two
surfaces. However, a plane rarely has two classes, and the line where two planes meet follows more exactly from their
equations than from the classes of points. Planar regions are therefore found without labels, and every pixel is
assigned to the plane that the pixel and its neighbours reach with the smallest shift along their rays. The class of a
point depends on its own probabilities, the probabilities of all points on its plane, and the plane's tilt, which
distinguishes walls, floors and ramps.
"""

from math import radians

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Pose, Values
from pipeline.frame import Frame
from pipeline.labels import Label
from pipeline.segments.planar_regions import planar_regions
from pipeline.semantic_map.classifier import CLASSES
from pipeline.semantic_map.planar_vote_kernels import (
    log_probabilities_of_possible,
    mean_logs,
    normalised_products,
    planes_of_pixels,
)

MAX_NORMAL_ANGLE = radians(6)
"""Maximum angle between the normals of a surfel and its region, rad; small, because labels do not separate planes."""
MAX_SHIFT, NOISE = 0.02, 0.008
"""A pixel is less than ``MAX_SHIFT + NOISE · depth²`` from its plane along the optical axis; m, 1/m."""
MAX_NEIGHBOUR_DISTANCE = 2
"""Maximum distance, in rows and columns, of the neighbours that help to choose the plane of a pixel that fits
several."""
MIN_PROBABILITY = 1e-3
"""Lower limit of a class's probability, which limits the evidence against the class."""
MAX_LEAN = radians(15)
"""Maximum angle of a floor, deck or ceiling to the horizontal, and of a wall or deck side to the vertical, rad."""
MIN_RAMP = radians(4)
"""Minimum tilt of an inclined ramp, rad."""


def vote_on_planes(
    frame: Frame, T_map_camera: Pose, probabilities: NDArray[np.float32], weight: float
) -> NDArray[np.float32]:
    """Let the points of every plane vote.

    The probabilities of a point on a plane are multiplied by their geometric mean over all points of the plane, which
    is raised to the power ``weight``, and then normalised. Before this step, the probabilities of classes that are
    impossible for the plane's tilt are moved to the possible classes. Points on no plane keep their probabilities.

    Args:
        frame: the frame.
        T_map_camera: pose of the camera.
        probabilities: (N, 6) float32 of the frame's returns, row-major, by class of ``CLASSES``; rows sum to 1.
        weight: weight of the plane; the point itself has the weight 1.

    Returns:
        (N, 6) float32 probabilities.
    """
    found = planar_regions(frame, frame.returns.astype(np.uint8), 0, MAX_NORMAL_ANGLE)
    plane = planes_of_pixels(
        frame.depth, frame.intrinsics.rays, found.surfels.of_pixel, found.surfels.neighbours, found.plane_of_surfel,
        found.planes, MAX_SHIFT, NOISE, MAX_NEIGHBOUR_DISTANCE,
    )[frame.returns]  # fmt: skip
    possible = possible_classes(found.planes[:, :3] @ T_map_camera[2, :3])
    logs = log_probabilities_of_possible(
        probabilities, plane, possible, CLASSES.index(Label.CLUTTER), MIN_PROBABILITY
    )
    evidence = weight * mean_logs(logs, plane, len(found.planes))
    return normalised_products(probabilities, logs, evidence, plane)


def possible_classes(cosines: Values) -> NDArray[np.bool_]:
    """(P, 6) which of ``CLASSES`` each plane may have, given the (P,) cosines between normals and the vertical."""
    lean = np.arccos(np.abs(cosines).clip(max=1))
    level, upright = lean < MAX_LEAN, lean > np.pi / 2 - MAX_LEAN
    possible = {
        Label.WALL: upright,
        Label.TERRAIN: level,
        Label.INCLINED_RAMP: lean > MIN_RAMP,
        Label.STRAIGHT_RAMP: level | upright,
        Label.CEILING: level,
        Label.CLUTTER: np.ones_like(level),
    }
    return np.stack([possible[label] for label in CLASSES], axis=1)
