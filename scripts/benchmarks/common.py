"""Code shared by the subjects of the benchmark."""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any, ClassVar, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Depth, Rgb
from pipeline.errors import InputError
from sarsim.sensors.rendering import COLOUR_QUALITY, Renderer
from scripts.benchmarks.settings import SubjectSettings

CameraName: TypeAlias = int | str | mujoco.MjvCamera


@dataclass(frozen=True)
class Result:
    """The results of a subject.

    Attributes:
        figures: figures by name; ratios compare contenders within this run.
        details: further content of the JSON file, under its own keys.
        notes: lines to print below the figures, such as which episodes failed.
    """

    figures: dict[str, float]
    details: dict[str, Any] = field(default_factory=dict)
    notes: Sequence[str] = ()


def check_at_least(minimum: int, settings: SubjectSettings, *names: str) -> None:
    """Raise InputError if one of the named settings is below ``minimum``; None passes."""
    for name in names:
        value = getattr(settings, name)
        if value is not None and value < minimum:
            raise InputError(f"--{name.replace('_', '-')} {value}: must be at least {minimum}")


def wall_time_of(action: Callable[..., object], *args: object) -> float:
    """Wall-clock time of a call, s."""
    start = time.perf_counter()
    action(*args)
    return time.perf_counter() - start


class ThreePasses(Renderer):
    """``mujoco.Renderer``, which draws colour, depth and segmentation in separate passes.

    Its images have MuJoCo's default quality except for ``QUALITY``, and stay valid until the next image is drawn.
    """

    QUALITY: ClassVar[Mapping[str, int]] = {}

    def __init__(self, model: mujoco.MjModel, width: int, height: int):
        ExitStack.__init__(self)  # not Renderer.__init__, which would make a second OpenGL context
        self.model, self.width, self.height = model, width, height
        default = mujoco.MjSpec().visual.quality
        for name in ("offsamples", "shadowsize", "numslices", "numstacks", "numquads"):
            setattr(model.vis.quality, name, self.QUALITY.get(name, getattr(default, name)))
        # Arenas set a larger framebuffer for the viewer; here it would only cost time.
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        self._renderer = mujoco.Renderer(model, height, width)
        self.callback(self._renderer.close)

    def colour(self, data: mujoco.MjData, camera: CameraName) -> Rgb:
        """The colour image of a camera."""
        self._renderer.disable_segmentation_rendering()
        return self._picture(data, camera)

    def depth(self, data: mujoco.MjData, camera: CameraName) -> Depth:
        """The depth image of a camera."""
        self._renderer.enable_depth_rendering()
        return self._picture(data, camera)

    def segmentation(self, data: mujoco.MjData, camera: CameraName) -> NDArray[np.int32]:
        """(H, W, 2) int32 object ids and object types."""
        self._renderer.enable_segmentation_rendering()
        return self._picture(data, camera)

    def segmentation_and_depth(
        self, data: mujoco.MjData, camera: CameraName
    ) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """(H, W) int32 geom ids, -1 where there is no geom, and (H, W) float32 depth, m."""
        depth = self.depth(data, camera).copy()
        ids = self.segmentation(data, camera)
        return np.where(ids[..., 1] == int(mujoco.mjtObj.mjOBJ_GEOM), ids[..., 0], -1), depth

    def _picture(self, data: mujoco.MjData, camera: CameraName) -> NDArray:
        self._renderer.update_scene(data, camera)
        return self._renderer.render()


class ThreePassesAtOurQuality(ThreePasses):
    """``ThreePasses`` with the quality of our own colour images."""

    QUALITY = COLOUR_QUALITY


RENDERERS: dict[str, type[Renderer]] = {
    "ours": Renderer,
    "renderer": ThreePasses,
    "renderer_at_our_quality": ThreePassesAtOurQuality,
}
"""The contenders in the subjects ``camera`` and ``dataset``, by name."""
