"""Average precision of a detector of people, in frames of arenas that no network was trained on."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Mask, Values
from pipeline.victims.detection.average_precision import AveragePrecision
from pipeline.victims.detection.detection import Detector
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.render import World, find_scene
from sarsim.dataset.settings import HarderArenaRange
from sarsim.scoring.visibility import VISIBLE
from sarsim.sensors.lighting import Lighting
from sarsim.sensors.rendering import Renderer

MOST_HIDDEN = 0.6  # Largest occluded share of a person who is to be found
DISTANCES = (0.0, 1.5, 2.5, 3.5, 5.0, np.inf)
"""m from the camera to the centre of a person, bounds of the intervals with separate average precision."""
HIDDEN = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # Occluded shares of a person, likewise


@dataclass(frozen=True, eq=False)
class PeopleInFrame:
    """The people in one frame, and a detector's boxes.

    Attributes:
        boxes: (V, 4) true, pixels.
        area: (V,) pixels that show each.
        hidden: occluded share of each within the image.
        distance: m from the camera to the centre of each.
        found: (N, 4) boxes of the detector.
        confidence: of the detector's boxes.
    """

    boxes: NDArray[np.float64]
    area: NDArray[np.int64]
    hidden: Values
    distance: Values
    found: NDArray[np.float64]
    confidence: Values

    @property
    def counts(self) -> Mask:
        """The people to be found."""
        return (self.area >= VISIBLE) & (self.hidden <= MOST_HIDDEN)


def recipe(seed: int, frames: int) -> Recipe:
    """Arenas with people, as in the training data except for the seed; the air is clear in three of four scenes."""
    arenas = HarderArenaRange(victims=(1, 6), furniture=(0.05, 0.35), bulky=(0.0, 0.4))
    return Recipe(seed=seed, frames=frames, random=arenas, keyframes=(0.5, 0.8))


def scene_frames(recipe: Recipe, index: int, lighting: Lighting, detector: Detector) -> Iterator[PeopleInFrame]:
    """The people and detections in each frame of a scene in one lighting; all else is the same in every lighting."""
    scene, arena = find_scene(with_lighting(recipe, lighting), index)
    noise = recipe.rng(index, "noise")
    with World(arena, scene, Renderer, recipe.width, recipe.height) as world:
        content = world.content()
        middle = content.victim_box.mean(axis=1)
        places = np.einsum("vij,vj->vi", content.victim_pose[:, :3, :3], middle) + content.victim_pose[:, :3, 3]
        for pose in world.drive(recipe, recipe.rng(index, "drive")).poses(recipe.frames):
            frame = world.capture(pose, noise)
            seen = np.flatnonzero(frame.victim_area > 0)
            alone = world.areas_alone()[seen] if len(seen) else np.zeros(0)
            camera = (frame.pose_true @ frame.frame.T_base_camera)[:3, 3]
            detections = detector.detect(frame.frame.rgb)
            yield PeopleInFrame(
                boxes=frame.victim_pixels[seen].astype(np.float64),
                area=frame.victim_area[seen].astype(np.int64),
                hidden=1 - frame.victim_area[seen] / np.maximum(alone, frame.victim_area[seen]),
                distance=np.linalg.norm(places[seen] - camera, axis=1),
                found=np.array([d.box for d in detections], np.float64).reshape(-1, 4),
                confidence=np.array([d.confidence for d in detections], np.float64),
            )


def ap50(frames: Sequence[PeopleInFrame]) -> float:
    """Average precision at an IoU of 0.5; NaN if no person is to be found."""
    return _average_precision(frames, [people.counts for people in frames])


def ap50_by(frames: Sequence[PeopleInFrame], attribute: str, bounds: Sequence[float]) -> dict[str, dict[str, float]]:
    """Average precision and number of people by intervals of an attribute, of people with enough pixels."""
    result = {}
    for low, high in pairwise(bounds):
        chosen = [_between(people, attribute, low, high) for people in frames]
        number = sum(int(c.sum()) for c in chosen)
        if number:
            result[f"{low:g}-{high:g}"] = {"ap50": _average_precision(frames, chosen), "people": number}
    return result


def _between(people: PeopleInFrame, attribute: str, low: float, high: float) -> Mask:
    """People in an interval of an attribute who are to be found, for "hidden" at any occluded share."""
    value = getattr(people, attribute)
    counts = people.area >= VISIBLE if attribute == "hidden" else people.counts
    return counts & (value >= low) & ((value < high) | (high == HIDDEN[-1]))


def _average_precision(frames: Sequence[PeopleInFrame], counts: Sequence[NDArray[np.bool_]]) -> float:
    """Average precision for the people who count; detections of others are neither right nor wrong."""
    result = AveragePrecision()
    for people, chosen in zip(frames, counts, strict=True):
        result.add(people.found, people.confidence, people.boxes, ~chosen)
    return result.value


def with_lighting(recipe: Recipe, lighting: Lighting) -> Recipe:
    """The recipe with all scenes in one lighting."""
    normal, dim, dark = (float(kind is lighting) for kind in Lighting)
    return replace(recipe, lighting=(normal, dim, dark))
