"""Frames of drives with true labels, and the accuracy of classifiers in these frames and in maps fused from them."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Labels, Pose
from pipeline.errors import required
from pipeline.frame import Frame
from pipeline.labels import Label
from pipeline.semantic_map.classifier import PointClassifier
from pipeline.semantic_map.semantic_map import SemanticMap
from sarsim.dataset.recipe import Recipe, SceneRecipe
from sarsim.dataset.render import World, arena_of
from sarsim.dataset.settings import KEYFRAME_SPACING
from sarsim.scoring.semantics import confusion_matrix, label_figures, map_figures
from sarsim.sensors.conditions import Conditions
from sarsim.sensors.lighting import Lighting
from sarsim.sensors.rendering import Renderer

LIGHTINGS = {"": Lighting.normal, ".dark": Lighting.dark}  # By suffix of the figures' names
SPARSE_KEYFRAMES = (2.0, 0.8)
"""Motion between compared frames, m and rad, which is large so that the frames show more than the start."""


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
        return required(self.frame.label)[self.frame.returns]


def drive_through(
    arena: str,
    frames: int,
    seed: int,
    lighting: Lighting = Lighting.normal,
    keyframes: tuple[float, float] = KEYFRAME_SPACING,
) -> Iterator[PosedFrame]:
    """Yield frames of a drive from the arena's start; the seed determines the path and the sensor's errors.

    ``frames``: number of frames; ``keyframes``: distance driven, m, and angle turned, rad, between frames.

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


Change = Callable[[PosedFrame, NDArray[np.float32]], NDArray[np.float32]]
"""A function that modifies the (N, 8) probabilities given by a classifier to the returns of a frame."""
AS_GIVEN: Mapping[str, Change] = {"": lambda frame, given: given}
KINDS = ("frame", "voxels", "fused")
Scores = dict[str, dict[str, dict[str, float]]]
"""``miou_four`` and the IoU by label, keyed by classifier name plus suffix of the change, then by kind."""


class Tally:
    """Compares labels of frames, and of the map fused from them, with the true labels."""

    def __init__(self) -> None:
        self._returns, self._voxels = np.zeros((2, len(Label), len(Label)), np.int64)
        self._map, self._truth = SemanticMap(), SemanticMap()

    def add(self, frame: PosedFrame, given: NDArray[np.float32]) -> None:
        """Count a frame, given the (N, 8) probabilities that a classifier assigned to its returns."""
        points, truth = frame.points, np.eye(len(Label), dtype=np.float32)[frame.labels]
        self._returns += confusion_matrix(frame.labels, given.argmax(axis=1).astype(np.uint8))
        alone, true = SemanticMap(), SemanticMap()
        for labels, of in ((alone, given), (true, truth), (self._map, given), (self._truth, truth)):
            labels.update(points, of)
        self._voxels += confusion_matrix(true.labels(), alone.labels())

    def scores(self) -> dict[str, dict[str, float]]:
        """IoU by label and ``miou_four``, by kind: over frames' returns, frames' voxels, and the fused map's voxels.

        Near surfaces have many more returns than far surfaces, but no more voxels, so that only the last two kinds
        are comparable.
        """
        figures = label_figures(self._returns), label_figures(self._voxels), map_figures(self._truth, self._map)
        return {
            kind: {"miou_four": of["miou_four"], **of["iou"]} if of else {}
            for kind, of in zip(KINDS, figures, strict=True)
        }


def scores(
    frames: Iterable[PosedFrame], classifiers: Mapping[str, PointClassifier], changes: Mapping[str, Change] = AS_GIVEN
) -> Scores:
    """The scores of every classifier in one arena, for each of the ``changes`` to the classifier's probabilities."""
    tallies = {name + change: Tally() for name in classifiers for change in changes}
    for frame in frames:
        for name, classifier in classifiers.items():
            given = classifier.classify(frame.frame, frame.points, frame.T_map_camera)
            for change, changed in changes.items():
                tallies[name + change].add(frame, changed(frame, given))
    return {name: tally.scores() for name, tally in tallies.items()}
