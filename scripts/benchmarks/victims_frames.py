"""Average precision of a person detector, in frames of arenas that no network was trained on."""

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

MOST_HIDDEN = 0.6  # Maximum occluded share of a person who should be found
DISTANCES = (0.0, 1.5, 2.5, 3.5, 5.0, np.inf)
"""Bounds, m, of the intervals of distance from camera to person's centre that have their own average precision."""
HIDDEN = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # Likewise, of a person's occluded share


@dataclass(frozen=True, eq=False)
class PeopleInFrame:
    """The people in one frame, and a detector's boxes.

    Attributes:
        boxes: (V, 4) true boxes, pixels.
        area: (V,) number of pixels that show each person.
        hidden: occluded share of each person's area within the image.
        distance: distance from the camera to each person's centre, m.
        found: (N, 4) detected boxes, pixels.
        confidence: confidence of each detected box.
    """

    boxes: NDArray[np.float64]
    area: NDArray[np.int64]
    hidden: Values
    distance: Values
    found: NDArray[np.float64]
    confidence: Values

    @property
    def counts(self) -> Mask:
        """The people who should be found."""
        return (self.area >= VISIBLE) & (self.hidden <= MOST_HIDDEN)


def recipe(seed: int, frames: int) -> Recipe:
    """Arenas with people, as in the training data but with another seed; three in four scenes have clear air."""
    arenas = HarderArenaRange(victims=(1, 6), furniture=(0.05, 0.35), bulky=(0.0, 0.4))
    return Recipe(seed=seed, frames=frames, random=arenas, keyframes=(0.5, 0.8))


def scene_frames(recipe: Recipe, index: int, lighting: Lighting, detector: Detector) -> Iterator[PeopleInFrame]:
    """The people and detections in each frame of a scene; ``lighting`` changes nothing else in the scene."""
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
    """Average precision at an IoU of 0.5; NaN if no person should be found."""
    return _average_precision(frames, [people.counts for people in frames])


def ap50_by(frames: Sequence[PeopleInFrame], attribute: str, bounds: Sequence[float]) -> dict[str, dict[str, float]]:
    """Average precision and number of people by interval of an attribute."""
    result = {}
    for low, high in pairwise(bounds):
        chosen = [_between(people, attribute, low, high) for people in frames]
        number = sum(int(c.sum()) for c in chosen)
        if number:
            result[f"{low:g}-{high:g}"] = {"ap50": _average_precision(frames, chosen), "people": number}
    return result


def _between(people: PeopleInFrame, attribute: str, low: float, high: float) -> Mask:
    """People in an interval of an attribute who should be found; for "hidden", whatever their occluded share."""
    value = getattr(people, attribute)
    counts = people.area >= VISIBLE if attribute == "hidden" else people.counts
    return counts & (value >= low) & ((value < high) | (high == HIDDEN[-1]))


def _average_precision(frames: Sequence[PeopleInFrame], counts: Sequence[NDArray[np.bool_]]) -> float:
    """Average precision for the people in ``counts``; detections of other people are ignored."""
    result = AveragePrecision()
    for people, chosen in zip(frames, counts, strict=True):
        result.add(people.found, people.confidence, people.boxes, ~chosen)
    return result.value


def with_lighting(recipe: Recipe, lighting: Lighting) -> Recipe:
    """The recipe with the same lighting in all scenes."""
    normal, dim, dark = (float(kind is lighting) for kind in Lighting)
    return replace(recipe, lighting=(normal, dim, dark))
