"""The transforms between the frames of a robot."""

import numpy as np
from numpy.typing import NDArray

from pipeline.ros.messages import BASE, Message, pose_matrix


class FrameTree:
    """Transforms between frames, by their names.

    Attributes:
        base: name of the robot's frame.
    """

    def __init__(self) -> None:
        self.base = BASE
        self._links: dict[str, tuple[str, NDArray[np.float64]]] = {}

    def take(self, message: Message) -> tuple[str, NDArray[np.float64]]:
        """Store a TransformStamped; returns the name of its parent frame and the 4×4 pose of its child in it."""
        T = pose_matrix(message.transform.translation, message.transform.rotation)
        parent = message.header.frame_id.strip("/")
        self._links[message.child_frame_id.strip("/")] = parent, T
        return parent, T

    def T_base(self, frame: str) -> NDArray[np.float64] | None:
        """4×4 pose of a frame in the robot's; None if no chain of transforms connects them."""
        T = np.eye(4)
        for _ in range(len(self._links) + 1):
            if frame.strip("/") == self.base.strip("/"):
                return T
            if frame.strip("/") not in self._links:
                return None
            frame, step = self._links[frame.strip("/")]
            T = step @ T
        return None
