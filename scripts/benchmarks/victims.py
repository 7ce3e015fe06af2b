"""Victims: the detector's average precision and speed, and how many the robot finds in complete episodes."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from rich.table import Table

from pipeline.arrays import Rgb
from pipeline.semantic_map.networks.threads import torch_threads
from pipeline.victims.config import DetectorConfig
from pipeline.victims.detection.detection import Detection, Detector
from pipeline.victims.detection.detector import VictimDetector
from sarsim.commands.cli import tracked
from sarsim.sensors.lighting import Lighting
from scripts.benchmarks.common import Result, at_least, seconds
from scripts.benchmarks.episodes import GROUPS, Job, Results, configs, run_jobs
from scripts.benchmarks.exploration_table import group_figures, groups_in, pairs, rich_table, rows_of
from scripts.benchmarks.settings import VictimsSettings
from scripts.benchmarks.victims_frames import DISTANCES, HIDDEN, PeopleInFrame, ap50, ap50_by, recipe, scene_frames

THREADS = 2
LEAST_CONFIDENCE = 0.01  # Average precision needs detections at all thresholds
BOUNDS = {"distance": DISTANCES, "hidden": HIDDEN}
"""Bounds of the intervals with separate average precision, by attribute of people."""
ROWS: Mapping[str, str] = {
    "episodes": "runs",
    "victims": "victims.present.sum",
    "found": "victims.found.sum",
    "visible within 3.5 m": "victims.visible.sum",
    "of these, found": "visible_found_share",
    "false alarms per episode": "victims.false_alarms.mean",
    "position error, m, median": "position_error_m.median",
    "time to see 90 %, relative to without": "seen90_vs_without",
    "time of the episode, relative to without": "sim_time_vs_without",
}
"""Names of the table's rows, and the figures in them."""


def measure(settings: VictimsSettings) -> Result:
    """The detector's speed and average precision in unseen arenas, and the victims found in complete episodes.

    Raises:
        InputError: a number is too low, a network is broken, or a folder cannot be used.
    """
    at_least(0, settings, "scenes", "rounds", "nist", "esogu", "random", "seed")
    at_least(1, settings, "frames", "workers")
    rounds, precise = settings.rounds, DetectorConfig(confidence=LEAST_CONFIDENCE)
    jobs = [Job(group, "ours", config) for group, config in configs(settings.episode, settings)]
    detector = VictimDetector.load(*settings.detector)
    figures = speed(detector, rounds, settings.seed) if rounds else {}
    precision, by = _precision(_frames(VictimDetector.load(*settings.detector, config=precise), settings))
    figures |= precision
    episodes, failed = _episodes(jobs, settings)
    figures |= episodes
    return Result(figures, {"ap50_by": by, "failed": failed}, _table(figures))


def _frames(detector: VictimDetector, settings: VictimsSettings) -> dict[str, list[PeopleInFrame]]:
    """People and detections in the frames of all scenes, by lighting."""
    arenas = recipe(settings.seed, settings.frames)
    result: dict[str, list[PeopleInFrame]] = {light.name: [] for light in Lighting if settings.scenes}
    for index in tracked(range(settings.scenes), "frames"):
        for light in Lighting:
            result[light.name] += scene_frames(arenas, index, light, detector)
    return result


def _precision(frames: Mapping[str, Sequence[PeopleInFrame]]) -> tuple[dict[str, float], dict[str, Any]]:
    """Average precision by lighting, and within each lighting by distance and by occluded share."""
    figures, by = {}, {}
    for light, seen in frames.items():
        if np.isfinite(value := ap50(seen)):
            figures[f"ap50.{light}"] = value
        figures[f"ap50.{light}.people"] = sum(int(people.counts.sum()) for people in seen)
        by[light] = {name: ap50_by(seen, name, bounds) for name, bounds in BOUNDS.items()}
    return figures, by


def _episodes(jobs: Sequence[Job], settings: VictimsSettings) -> tuple[dict[str, float], list[str]]:
    """Figures by group, and the names of the failed episodes."""
    if not jobs:
        return {}, []
    found = run_jobs(jobs, settings.runs, settings.workers)
    bare = [replace(job, config=replace(job.config, detector=None)) for job in jobs if settings.baselines]
    others = run_jobs(bare, settings.runs / "without", settings.workers) if bare else []
    figures: dict[str, float] = {}
    for group in dict.fromkeys(job.group for job in jobs):
        members = [number for number, job in enumerate(jobs) if job.group == group]
        figures |= figures_of(group, [found[n] for n in members], [others[n] for n in members if others])
    return figures, [job.name for job, result in zip(jobs, found, strict=True) if result is None]


def figures_of(group: str, found: Results, without: Results) -> dict[str, float]:
    """Figures of one group: victims, share found, position error, and times relative to episodes ``without``."""
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
    """Ratios, with over without the detector, of time to see 90 % and total time: medians over the arenas."""
    both = pairs(found, without)
    seen = [(a["exploration"], b["exploration"]) for a, b in both]
    ratios: Mapping[str, list[float]] = {
        "sim_time_vs_without": [a["sim_time_s"] / b["sim_time_s"] for a, b in both],
        "seen90_vs_without": [a["t90_s"] / b["t90_s"] for a, b in seen if "t90_s" in a and "t90_s" in b],
    }
    return {f"{group}.{name}": float(np.median(values)) for name, values in ratios.items() if values}


def _table(figures: Mapping[str, float]) -> Table | None:
    """A table with a column for each group, and speed and precision below; None without episodes."""
    if not groups_in(figures):
        return None
    table = rich_table("victims", figures, [rows_of(figures, ROWS)])
    general = {name: value for name, value in figures.items() if name.split(".")[0] not in GROUPS}
    table.caption = "\n".join(f"{name} {value:.4g}" for name, value in general.items())
    return table


def speed(detector: Detector, rounds: int, seed: int) -> dict[str, float]:
    """Mean ms of the detector over frames of a random arena, as its time depends on the image's content."""
    times: list[float] = []

    class Timed:
        """The detector, timed."""

        def detect(self, rgb: Rgb) -> list[Detection]:
            """Time the detector, after a warm-up, and return no detections."""
            if not times:
                detector.detect(rgb)
            times.append(seconds(detector.detect, rgb))
            return []

    with torch_threads(THREADS):
        for _ in scene_frames(recipe(seed, rounds), 0, Lighting.normal, Timed()):
            pass
    return {"detector_ms": float(1e3 * np.mean(times))}
