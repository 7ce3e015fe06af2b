"""The interface of point classifiers, and a classifier that returns the simulator's true labels."""

from typing import Protocol

import numpy as np

from pipeline.arrays import Points, Pose, Probabilities
from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.labels import Label

CLASSES = (Label.WALL, Label.TERRAIN, Label.INCLINED_RAMP, Label.STRAIGHT_RAMP, Label.CEILING, Label.CLUTTER)
"""The classes of a network, in the order of its outputs."""
TOLERANCE = 1e-3
"""Maximum difference between 1 and the sum of a point's probabilities; rounding to float16 adds up to 0.0005."""


class PointClassifier(Protocol):
    """Computes the class probabilities of every point of a frame.

    The map does not revise the labels of a classifier whose attribute ``is_certain`` is True.
    """

    def classify(self, frame: Frame, points: Points, T_map_camera: Pose) -> Probabilities:
        """Classify the returns of a frame.

        Args:
            frame: the frame of the points.
            points: all returns, row-major, as ``frame.points`` returns them, m in ``map``, but with z relative to the
                height at which the robot was set down.
            T_map_camera: pose of the frame's camera, with z relative to the same height.

        Returns:
            Probabilities that sum to 1 for each point.
        """
        ...


def check_probabilities(probabilities: object, points: int, classifier: object) -> None:
    """Check that a classifier has returned class probabilities (points, 8) that sum to 1 for each point.

    Raises:
        InputError: it has returned something else.
    """
    wanted = (
        f"{type(classifier).__name__}.classify: must return probabilities of shape ({points}, {len(Label)}), "
        "at least 0 and with the sum 1 for each point"
    )
    if not isinstance(probabilities, np.ndarray):
        raise InputError(f"{wanted}, not {type(probabilities).__name__}")
    if probabilities.shape != (points, len(Label)):
        raise InputError(f"{wanted}, not an array of shape {probabilities.shape}")
    sums_to_1 = np.abs(probabilities.sum(axis=1, dtype=np.float32) - 1) <= TOLERANCE
    right = sums_to_1 & (probabilities >= 0).all(axis=1)
    if not right.all():
        raise InputError(f"{wanted}, not {probabilities[~right][0].tolist()}")


class TruthClassifier(PointClassifier):
    """Returns the labels that the simulator wrote into the frame (``--labels truth``)."""

    is_certain = True

    def classify(self, frame: Frame, points: Points, T_map_camera: Pose) -> Probabilities:
        """One-hot probabilities of ``frame.label`` at the returns; InputError if the frame has no labels."""
        if frame.label is None:
            raise InputError(
                f"the frame at {frame.time:.2f} s has no true labels, which --labels truth requires; "
                "choose another source with --labels, such as pointnext"
            )
        return np.eye(len(Label), dtype=np.float32)[frame.label[frame.returns]]
