"""The named frames of a model or a world, each with its pose relative to another of these frames."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Pose
from pipeline.errors import InputError
from pipeline.transforms import inverse

MODEL = "__model__"
"""Name of a model's own frame within the model."""


@dataclass(frozen=True, eq=False)
class _Frame:
    """A frame, which may be the frame of a nested model.

    Attributes:
        T: pose of the frame; for a nested model, pose of the model's frame ``placement_frame``.
        relative_to: name of the frame in which the pose is given.
        fallback: name of the frame to use if ``relative_to`` does not exist.
        inside: frames of the nested model; None if the frame is not a model's frame.
        placement_frame: name of the nested model's frame to which the pose applies.
        merged: whether the nested model's frames also belong to this scope.
    """

    T: Pose
    relative_to: str
    fallback: str
    nested_frames: "Frames | None"
    placement_frame: str
    merged: bool


class Frames:
    """The frames of one scope.

    Attributes:
        root: name of the scope's own frame.
    """

    def __init__(self, where: str, root: str = MODEL):
        """``where``: location for error messages."""
        self.root = root
        self._where = where
        self._frames: dict[str, _Frame] = {}
        self._poses: dict[str, NDArray[np.float64]] = {}
        self._resolving: list[str] = []

    def add(
        self, name: str, T: Pose, relative_to: str,
        nested_frames: "Frames | None" = None, placement_frame: str = MODEL, merged: bool = False, fallback: str = "",
    ) -> str:  # fmt: skip
        """Add a frame and return its name.

        If the name is already in use, which is an error in the file, the name is changed.

        Args:
            name: name of the frame.
            T: pose of the frame.
            relative_to: name of the frame in which the pose is given.
            inside: frames of a nested model.
            placement_frame: name of the nested model's frame to which the pose applies.
            merged: whether the nested model's frames also belong to this scope.
            fallback: name of the frame to use if ``relative_to`` does not exist.
        """
        while name in self._frames:
            name += "'"
        self._frames[name] = _Frame(T, relative_to, fallback, nested_frames, placement_frame, merged)
        return name

    def has(self, name: str) -> bool:
        """Whether there is a frame of this name, which may be in a nested model (``model::frame``)."""
        outer, _, inner = name.partition("::")
        within = self._frames[outer].nested_frames if outer in self._frames else None
        merged = [frame.nested_frames for frame in self._frames.values() if frame.merged]
        return (
            name in (self.root, *self._frames)
            or bool(inner and within is not None and within.has(inner))
            or any(nested_frames.has(name) for nested_frames in merged if nested_frames is not None)
        )

    def pose(self, name: str, fallback: str = "") -> Pose:
        """Pose, relative to this scope's own frame, of a frame that may be in a nested model (``model::frame``).

        If the frame does not exist and ``fallback`` is given, the pose of the frame ``fallback`` is returned.

        Raises:
            InputError: there is no such frame, or the poses of frames form a cycle.
        """
        if fallback and not self.has(name):
            name = fallback
        if name == self.root:
            return np.eye(4)
        if name in self._frames:  # also if ``::`` is part of the name itself, as in old Gazebo files
            return self._pose(name)
        outer, _, inner = name.partition("::")
        if outer not in self._frames:
            return self._merged_pose(name)
        T, nested_frames = self._pose(outer), self._frames[outer].nested_frames
        if nested_frames is None:
            raise InputError(f"{self._where}: there is no frame {name[:60]!r}")
        return T @ nested_frames.pose(inner)

    def _merged_pose(self, name: str) -> NDArray[np.float64]:
        for key, frame in self._frames.items():
            if frame.merged and frame.nested_frames is not None and frame.nested_frames.has(name):
                return self._pose(key) @ frame.nested_frames.pose(name)
        raise InputError(f"{self._where}: there is no frame {name[:60]!r}")

    def _pose(self, name: str) -> NDArray[np.float64]:
        if name in self._resolving:
            raise InputError(
                f"{self._where}: the poses of these frames form a cycle: {', '.join(self._resolving)[:200]}"
            )
        if name not in self._poses:
            frame = self._frames[name]
            self._resolving.append(name)
            try:
                T = self.pose(frame.relative_to, frame.fallback) @ frame.T
            finally:
                self._resolving.remove(name)
            if frame.nested_frames is not None and frame.placement_frame != MODEL:
                T = T @ inverse(frame.nested_frames.pose(frame.placement_frame))
            self._poses[name] = T
        return self._poses[name]
