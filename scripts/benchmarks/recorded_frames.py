"""Frames of an episode, recorded so that several mappers get the same ones."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Poses
from pipeline.errors import required
from pipeline.explorer import Explorer
from pipeline.frame import Intrinsics
from pipeline.robot import Motion
from pipeline.sink import Sink
from pipeline.transforms import transform_places
from sarsim.arenas.load import load_arena
from sarsim.commands.cli import progress
from sarsim.composition import TRUE_LABELS, make_mapper
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig

STEPS = 160  # Maximum number of steps of an episode


@dataclass(frozen=True, eq=False)
class RecordedFrames:
    """N frames of an episode.

    Attributes:
        intrinsics: intrinsics of all depth images.
        ideal: (N, H, W) float32 noise-free depth, m, clipped to the sensor's range.
        xtion: (N, H, W) float32 depth with the Xtion's noise, m.
        T_map_camera: (N, 4, 4) true poses of ``camera_optical``.
    """

    intrinsics: Intrinsics
    ideal: NDArray[np.float32]
    xtion: NDArray[np.float32]
    T_map_camera: Poses

    def points(self, depth: NDArray[np.float32], n: int) -> NDArray[np.float64]:
        """(M, 3) returns of image ``n`` of a sensor's ``depth`` (N, H, W), in ``map``, m."""
        T = self.T_map_camera[n]
        returns = depth[n] > 0
        rays = self.intrinsics.rays[returns].astype(np.float64)
        return transform_places(T, rays * depth[n][returns, None])


def record(arena: str, seed: int, frames: int) -> RecordedFrames:
    """Let the robot explore for an episode, and keep frames evenly spaced in time.

    Raises:
        InputError: the arena cannot be loaded.
    """
    robot = SimulatedRobot(load_arena(arena), SimulationConfig(), seed)
    explorer = Explorer(robot, make_mapper(TRUE_LABELS, robot.model, seed))
    album = _Album(robot, frames)
    explorer.watch(album)
    with progress(transient=True) as bars:
        bar = bars.add_task(f"steps of a recording in {arena}", total=None)
        step = explorer.step()
        while step.plan is not None and explorer.steps < STEPS:
            explorer.drive(step)
            bars.advance(bar)
            step = explorer.step()
    robot.close()
    ideal, xtion, poses = (np.array(column) for column in zip(*album.chosen(), strict=True))
    return RecordedFrames(step.keyframe.frame.intrinsics, ideal, xtion, poses)


class _Album(Sink):
    """Takes frames at a constant period, which doubles whenever there are twice as many as wanted."""

    def __init__(self, robot: SimulatedRobot, wanted: int):
        self._robot, self._wanted = robot, wanted
        self._period, self._next = 1.0, robot.time
        self._frames: list[tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float64]]] = []

    def on_motion(self, motion: Motion) -> None:
        """Take a frame if one is due."""
        if motion.time < self._next:
            return
        self._next += self._period
        depth = self._robot.sense().depth
        truth = required(self._robot.true_frame)
        self._frames.append((truth.image.depth, depth, truth.image.T_world_camera))
        if len(self._frames) == 2 * self._wanted:
            del self._frames[1::2]
            self._period *= 2

    def chosen(self) -> list[tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float64]]]:
        """The wanted number of evenly spaced frames, or all if there are fewer."""
        places = np.linspace(0, len(self._frames) - 1, min(self._wanted, len(self._frames)))
        return [self._frames[n] for n in np.rint(places).astype(int)]
