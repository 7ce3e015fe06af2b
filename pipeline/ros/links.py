"""The transforms between the frames of a robot."""

from collections.abc import Iterator

import numpy as np

from pipeline.arrays import Pose
from pipeline.ros.messages import BASE, Message, pose_matrix
from pipeline.transforms import inverse


class FrameTree:
    """Transforms between frames, by their names.

    Attributes:
        base: name of the robot's frame.
    """

    def __init__(self) -> None:
        self.base = BASE
        self._links: dict[str, tuple[str, Pose]] = {}

    def take(self, message: Message) -> tuple[str, Pose]:
        """Store a TransformStamped; returns the name of its parent frame and the pose of its child in it."""
        T = pose_matrix(message.transform.translation, message.transform.rotation)
        parent = message.header.frame_id.strip("/")
        self._links[message.child_frame_id.strip("/")] = parent, T
        return parent, T

    def T_base(self, frame: str) -> Pose | None:
        """Pose of a frame in the robot's; None if no chain of transforms connects them."""
        return next((T for name, T in self._above(frame) if name == self.base.strip("/")), None)

    def between(self, frame: str, other: str) -> Pose | None:
        """Pose of another frame in a frame; None if they hang on no common one."""
        above = dict(self._above(frame))
        return next((inverse(above[name]) @ T for name, T in self._above(other) if name in above), None)

    def _above(self, frame: str) -> Iterator[tuple[str, Pose]]:
        """The names of a frame and of those that it hangs on, and the frame's pose in each."""
        name, T = frame.strip("/"), np.eye(4)
        yield name, T
        for _ in range(len(self._links)):
            if name not in self._links:
                return
            name, step = self._links[name]
            T = step @ T
            yield name, T
