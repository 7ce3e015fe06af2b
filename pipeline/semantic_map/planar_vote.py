"""Points of one plane decide together what they are.

A network that sees one column at a time makes errors in speckles, and at edges, where its voxels hold two surfaces.
But a plane is hardly ever of two classes, and where two planes meet is known better from their equations than from
the class of any point. So planar regions are found without labels, and every pixel goes to the plane to which it
and its neighbours move least along their rays. The class of a point follows from its own probabilities, from those
of all points on its plane, and from how the plane leans, for that defines what a wall, the floor or a ramp is.
"""

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.labels import Label
from pipeline.segments.planar_regions import planar_regions
from pipeline.semantic_map.classifier import CLASSES
from pipeline.semantic_map.planar_vote_kernels import mean_logs, normalised_products, planes_of_pixels, possible_logs

MAX_ANGLE = np.deg2rad(6)
"""rad, between a surfel's normal and its region's: small, as no labels tell planes apart."""
MAX_SHIFT, NOISE = 0.02, 0.008
"""m, and m per m² of depth that is added: how far along the optical axis a pixel may be from its plane."""
WINDOW = 2  # pixels, how far around it where a pixel that could be on several planes is decided on
WEIGHT = 2.0  # Of the plane's mean opinion, as evidence; a point's own is 1
FLOOR = 1e-3  # Least probability of a class: how little a network is believed that rules one out
LEVEL = np.deg2rad(15)  # rad; the floor, a deck and a ceiling lean by less
UPRIGHT = np.deg2rad(75)  # rad; a wall and the sides of a deck lean by more
SLOPE = np.deg2rad(4)  # rad; a ramp leans by more


def planar_vote(
    frame: Frame, T_map_camera: NDArray[np.float64], probabilities: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Let the points of every plane vote.

    The probabilities of a point on a plane become the normalised product of its own and of the geometric mean over
    all points of the plane, the latter to the power of ``WEIGHT``. Before that, classes that a plane so inclined
    cannot be of give theirs to those that it can be of. Points on no plane keep what they have.

    Args:
        frame: one frame.
        T_map_camera: 4×4 pose of the camera.
        probabilities: (N, 6) float32 of its returns, row-major, by class of ``CLASSES``; the rows sum to 1.

    Returns:
        (N, 6) float32.
    """
    found = planar_regions(frame, frame.returns.astype(np.uint8), 0, MAX_ANGLE)
    plane = planes_of_pixels(
        frame.depth, frame.intrinsics.rays, found.surfels.of_pixel, found.surfels.near, found.region,
        found.planes, MAX_SHIFT, NOISE, WINDOW,
    )[frame.returns]  # fmt: skip
    possible = possible_classes(found.planes[:, :3] @ T_map_camera[2, :3])
    logs = possible_logs(probabilities, plane, possible, CLASSES.index(Label.CLUTTER), FLOOR)
    evidence = WEIGHT * mean_logs(logs, plane, len(found.planes))
    return normalised_products(probabilities, logs, evidence, plane)


def possible_classes(cosines: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(P, 6) which of ``CLASSES`` a plane may be of, by the (P,) cosines between normals and the vertical."""
    lean = np.arccos(np.abs(cosines).clip(max=1))
    level, upright = lean < LEVEL, lean > UPRIGHT
    possible = {
        Label.WALL: upright,
        Label.TERRAIN: level,
        Label.INCLINED_RAMP: lean > SLOPE,
        Label.STRAIGHT_RAMP: level | upright,
        Label.CEILING: level,
        Label.CLUTTER: np.ones_like(level),
    }
    return np.stack([possible[label] for label in CLASSES], axis=1)
