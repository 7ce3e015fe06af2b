"""Frames of a drive through an arena, with true labels."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Labels, Pose
from pipeline.frame import Frame
from sarsim.dataset.recipe import Recipe, SceneRecipe
from sarsim.dataset.render import World, arena_of
from sarsim.dataset.settings import KEYFRAME_WAY
from sarsim.sensors.conditions import Conditions
from sarsim.sensors.lighting import Lighting
from sarsim.sensors.rendering import Renderer


@dataclass(frozen=True, eq=False)
class PosedFrame:
    """A frame with its true pose.

    Attributes:
        frame: the frame, with the Xtion's noise and true labels.
        T_map_camera: true pose of ``camera_optical``.
    """

    frame: Frame
    T_map_camera: Pose

    @property
    def points(self) -> NDArray[np.float32]:
        """(N, 3) float32 returns in ``map``, m."""
        return self.frame.points(self.T_map_camera)

    @property
    def labels(self) -> Labels:
        """True labels of the returns."""
        assert self.frame.label is not None
        return self.frame.label[self.frame.returns]


def drive_through(
    arena: str,
    frames: int,
    seed: int,
    lighting: Lighting = Lighting.normal,
    keyframes: tuple[float, float] = KEYFRAME_WAY,
) -> Iterator[PosedFrame]:
    """``frames`` frames of a drive from the arena's start; the seed determines the path and the sensor's errors.

    ``keyframes``: distance driven, m, and angle turned, rad, between frames.

    Raises:
        InputError: the arena cannot be loaded, or the robot cannot drive in it.
    """
    recipe = Recipe(seed=seed, frames=frames, keyframes=keyframes)
    scene = SceneRecipe(0, arena, None, Conditions(lighting=lighting))
    with World(arena_of(scene), scene, Renderer, recipe.width, recipe.height) as world:
        noise = recipe.rng(0, "noise")
        for pose in world.drive(recipe, recipe.rng(0, "drive")).poses(frames):
            seen = world.capture(pose, noise)
            yield PosedFrame(seen.frame, seen.pose_true @ seen.frame.T_base_camera)
