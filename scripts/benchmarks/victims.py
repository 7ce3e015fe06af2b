"""Victims: the detector's average precision and speed, and the fraction that the robot finds in complete episodes.

Average precision is measured in frames of arenas on which no network was trained.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Mask, Rgb, Values
from pipeline.semantic_map.networks.threads import torch_threads
from pipeline.victims.config import DetectorConfig
from pipeline.victims.detection import Detection, Detector
from pipeline.victims.detector import VictimDetector
from sarsim.commands.cli import tracked
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.render import World, find_scene
from sarsim.dataset.settings import HarderArenaRange
from sarsim.scoring.visibility import MIN_VISIBLE_PIXELS
from sarsim.sensors.lighting import Lighting
from sarsim.sensors.rendering import Renderer
from scripts.benchmarks.average_precision import AveragePrecision
from scripts.benchmarks.common import Result, check_at_least, wall_time_of
from scripts.benchmarks.reports import group_figures, pairs
from scripts.benchmarks.runs import Job, Results, failures, jobs_of, run_episode, run_jobs
from scripts.benchmarks.settings import VictimsSettings

THREADS = 2
MIN_CONFIDENCE = 0.01  # Average precision needs detections at all thresholds
MAX_HIDDEN = 0.6  # Maximum occluded fraction of a person whom the detector has to find


def measure(settings: VictimsSettings) -> Result:
    """The detector's speed and average precision in unseen arenas, and the victims found in complete episodes.

    Raises:
        InputError: a number is too low, a network is broken, or a folder cannot be used.
    """
    check_at_least(0, settings, "scenes", "rounds", "seed")
    check_at_least(1, settings, "frames")
    # The detector's speed.
    detector = VictimDetector.load(*settings.detector)
    precise = VictimDetector.load(*settings.detector, config=DetectorConfig(confidence=MIN_CONFIDENCE))
    figures = speed(detector, settings.rounds, settings.seed) if settings.rounds else {}
    # The detector's average precision in frames of unseen arenas, from the same viewpoints in each light.
    arenas = recipe(settings.seed, settings.frames)
    for light in tracked(Lighting if settings.scenes else (), "frames"):
        seen = [one for n in range(settings.scenes) for one in people_in_scene(arenas, n, light, precise)]
        if np.isfinite(value := ap50(seen)):
            figures[f"ap50.{light.name}"] = value
        figures[f"ap50.{light.name}.people"] = sum(int(people.counts.sum()) for people in seen)
    # The people found in complete episodes.
    episodes, failed = episode_figures(settings)
    return Result(figures | episodes, {"failed": failed}, [f"{name} failed; see its log" for name in failed])


def episode_figures(settings: VictimsSettings) -> tuple[dict[str, float], list[str]]:
    """Figures by group, and the names of the failed episodes; the baseline has no detector."""
    if not settings.arenas:
        return {}, []
    jobs = list(jobs_of(settings.episode, settings))
    bare = [without_detector(job) for job in jobs if settings.baselines]
    results = run_jobs([*jobs, *bare], settings, run_episode)
    figures: dict[str, float] = {}
    for group in dict.fromkeys(job.group for job in jobs):
        found, without = (
            [result for job, result in zip([*jobs, *bare], results, strict=True) if job.group == name]
            for name in (group, f"without.{group}")
        )
        figures |= figures_of(group, found, without)
    return figures, failures([*jobs, *bare], results)


def without_detector(job: Job) -> Job:
    """The same episode without a detector, in a group of its own."""
    return Job(f"without.{job.group}", replace(job.config, detector=None, detector_class=None))


def figures_of(group: str, found: Results, without: Results) -> dict[str, float]:
    """Figures of one group: victims, fraction found, position error, and times relative to runs without detector."""
    scored = [result for result in found if result and "report" in result]
    figures = {f"{group}.runs": float(len(scored))}
    victims = group_figures([{"victims": result["report"]["victims"]} for result in scored])
    figures |= {f"{group}.{key}": value for key, value in victims.items()}
    if visible := figures.get(f"{group}.victims.visible.sum", 0):
        figures[f"{group}.visible_found_share"] = figures[f"{group}.victims.visible_found.sum"] / visible
    if errors := [error for result in scored for error in result["position_errors"]]:
        figures[f"{group}.position_error_m.median"] = float(np.median(errors))
    return figures | _times(group, found, without)


def _times(group: str, found: Results, without: Results) -> dict[str, float]:
    """Medians, over arenas, of the ratios of times with the detector to times without: in total, and to see 90%."""
    both = pairs(found, without)
    seen = [(a["exploration"], b["exploration"]) for a, b in both]
    ratios: Mapping[str, list[float]] = {
        "sim_time_vs_without": [a["sim_time_s"] / b["sim_time_s"] for a, b in both],
        "seen90_vs_without": [a["t90_s"] / b["t90_s"] for a, b in seen if "t90_s" in a and "t90_s" in b],
    }
    return {f"{group}.{name}": float(np.median(values)) for name, values in ratios.items() if values}


def speed(detector: Detector, rounds: int, seed: int) -> dict[str, float]:
    """Mean time of the detector, ms, over frames of a random arena, because its time depends on the image."""
    times: list[float] = []

    class Timed:
        """The detector, timed."""

        def detect(self, rgb: Rgb) -> list[Detection]:
            """Time the detector, after a warm-up, and return no detections."""
            if not times:
                detector.detect(rgb)
            times.append(wall_time_of(detector.detect, rgb))
            return []

    with torch_threads(THREADS):
        for _ in people_in_scene(recipe(seed, rounds), 0, Lighting.normal, Timed()):
            pass
    return {"detector_ms": float(1e3 * np.mean(times))}


@dataclass(frozen=True, eq=False)
class PeopleInFrame:
    """The people in one frame, and a detector's boxes.

    Attributes:
        boxes: (V, 4) true boxes, pixels.
        area: (V,) number of pixels that show each person.
        hidden: occluded fraction of each person's area within the image.
        found: (N, 4) detected boxes, pixels.
        confidence: confidence of each detected box.
    """

    boxes: NDArray[np.float64]
    area: NDArray[np.int64]
    hidden: Values
    found: NDArray[np.float64]
    confidence: Values

    @property
    def counts(self) -> Mask:
        """(V,) whether the detector has to find each person."""
        return (self.area >= MIN_VISIBLE_PIXELS) & (self.hidden <= MAX_HIDDEN)


def recipe(seed: int, frames: int) -> Recipe:
    """Arenas with people, as in the training data but with another seed; three in four scenes have clear air."""
    arenas = HarderArenaRange(victims=(1, 6), furniture=(0.05, 0.35), bulky=(0.0, 0.4))
    return Recipe(seed=seed, frames=frames, random=arenas, keyframes=(0.5, 0.8))


def people_in_scene(recipe: Recipe, index: int, lighting: Lighting, detector: Detector) -> Iterator[PeopleInFrame]:
    """Yield the people and detections in each frame of a scene; ``lighting`` changes nothing else in the scene."""
    scene, arena = find_scene(with_lighting(recipe, lighting), index)
    noise = recipe.rng(index, "noise")
    with World(arena, scene, Renderer, recipe.width, recipe.height) as world:
        for pose in world.drive(recipe, recipe.rng(index, "drive")).poses(recipe.frames):
            frame = world.capture(pose, noise)
            seen = np.flatnonzero(frame.victim_area > 0)
            alone = world.unoccluded_areas()[seen] if len(seen) else np.zeros(0)
            detections = detector.detect(frame.frame.rgb)
            yield PeopleInFrame(
                boxes=frame.victim_pixels[seen].astype(np.float64),
                area=frame.victim_area[seen].astype(np.int64),
                hidden=1 - frame.victim_area[seen] / np.maximum(alone, frame.victim_area[seen]),
                found=np.array([d.box for d in detections], np.float64).reshape(-1, 4),
                confidence=np.array([d.confidence for d in detections], np.float64),
            )


def ap50(frames: Sequence[PeopleInFrame]) -> float:
    """Average precision at an IoU of 0.5, ignoring people who need not be found; NaN if nobody has to be found."""
    result = AveragePrecision()
    for people in frames:
        result.add(people.found, people.confidence, people.boxes, ~people.counts)
    return result.value


def with_lighting(recipe: Recipe, lighting: Lighting) -> Recipe:
    """The recipe with the same lighting in all scenes."""
    normal, dim, dark = (float(kind is lighting) for kind in Lighting)
    return replace(recipe, lighting=(normal, dim, dark))
