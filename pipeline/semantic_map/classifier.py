"""Point classifiers: their interface, and the one that gives the simulator's true labels."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.labels import Label

CLASSES = (Label.WALL, Label.TERRAIN, Label.INCLINED_RAMP, Label.STRAIGHT_RAMP, Label.CEILING, Label.CLUTTER)
"""The classes of a network, in the order of its outputs."""


class PointClassifier(Protocol):
    """Gives every point of a frame its class probabilities."""

    def classify(
        self, frame: Frame, points: NDArray[np.float32], T_map_camera: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """Classify the returns of a frame.

        Args:
            frame: the frame of the points.
            points: (N, 3) float32 in ``map``, all returns row-major, as ``frame.points`` gives them.
            T_map_camera: 4×4 pose of the frame's camera.

        Returns:
            (N, 8) float32 class probabilities, indexed by :class:`pipeline.labels.Label`; rows sum to 1.
        """
        ...


class TruthClassifier:
    """The labels that the simulator wrote into the frame (``--labels truth``)."""

    def classify(
        self, frame: Frame, points: NDArray[np.float32], T_map_camera: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """(N, 8) float32 one-hot of ``frame.label`` at the returns; InputError if the frame has none."""
        if frame.label is None:
            raise InputError(f"the frame at {frame.time:.2f} s carries no true labels: only a simulator knows them")
        return np.eye(len(Label), dtype=np.float32)[frame.label[frame.returns]]
