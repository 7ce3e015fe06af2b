"""Victims: how well the detector finds people in frames, how fast, and whom the robot finds in whole episodes."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count, islice
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from rich.progress import track
from rich.table import Table

from pipeline.errors import InputError
from pipeline.victims.detection.detector import VictimDetector
from pipeline.victims.detection.weights import load_network
from sarsim.episode import DETECTOR, WEIGHTS, EpisodeConfig, Labels, make_classifier
from sarsim.scripts.benchmarks.exploration_episode import Job
from sarsim.scripts.benchmarks.exploration_figures import group_figures
from sarsim.scripts.benchmarks.exploration_processes import cores, run_jobs
from sarsim.scripts.benchmarks.subject import Result, Subject
from sarsim.scripts.benchmarks.victims_frames import (
    DISTANCES,
    HIDDEN,
    People,
    ap50,
    ap50_by,
    recipe,
    scene_frames,
)
from sarsim.scripts.benchmarks.victims_speed import speed, tiny
from sarsim.sensors.lighting import Lighting
from sarsim.simulated_robot import SimulationConfig

GROUPS = ("nist_6x4", "esogu_52x15", "random")
Results = Sequence[dict[str, Any] | None]


@dataclass(frozen=True)
class VictimsBenchmark(Subject):
    """Average precision in new arenas, the detector's speed, and the victims of whole episodes."""

    detector: tuple[Path, Path] = DETECTOR
    """Darknet's .cfg and .weights of a YOLOv3."""
    scenes: int = 30
    """Random arenas whose frames are looked at, each in normal, dim and dark light; 0 for none."""
    frames: int = 12
    """Looks at each."""
    seed: int = 2026
    """Of these arenas; not one that a network was trained with."""
    rounds: int = 15
    """Frames that are timed."""
    nist: int = 10
    """Seeds in nist_6x4."""
    esogu: int = 2
    """Seeds in esogu_52x15."""
    random: int = 30
    """Random arenas, of difficulties 0, 1 and 2."""
    without: bool = True
    """Whether every episode is run without the detector too, to see whether it takes time."""
    steps: int = 1000
    """Looks at most; an episode ends before when nothing is left to look at."""
    labels: Labels = "dgcnn"
    """Who says what a point belongs to: the network, or the simulator."""
    weights: Path = WEIGHTS
    """Of that network."""
    simulation: Annotated[SimulationConfig, tyro.conf.arg(name="")] = field(default_factory=SimulationConfig)
    """Of the robot's body."""
    """Settings of every stage."""
    workers: int | None = None
    """Episodes at a time; if not given, as many as there are cores."""
    runs: Path = Path("runs/benchmark-victims")
    """Folder for what each episode finds out; those that are there already are not run again."""

    def measure(self) -> Result:
        """Speed, precision, episodes.

        Raises:
            InputError: nothing is to be measured, a network is broken, or a folder cannot be had.
        """
        self._check()
        network = load_network(*self.detector)
        figures = speed(network, self.rounds) if self.rounds else {}
        if self.rounds:
            figures |= {f"tiny.{name}": value for name, value in speed(tiny(), self.rounds).items()}
        details: dict[str, Any] = {"ap50_by": {}}
        for light, frames in self._frames(VictimDetector(network, LOWEST_CONFIDENCE)).items():
            value = ap50(frames)
            if np.isfinite(value):
                figures[f"ap50.{light}"] = value
            figures[f"ap50.{light}.people"] = sum(int(people.counts.sum()) for people in frames)
            by = {name: ap50_by(frames, name, bounds) for name, bounds in _BOUNDS.items()}
            details["ap50_by"][light] = by
        episodes, failed = self._episodes()
        return Result(figures | episodes, details | failed, _table(figures | episodes))

    def _check(self) -> None:
        numbers = (self.scenes, self.frames, self.rounds, self.nist, self.esogu, self.random, self.seed)
        if min(numbers) < 0 or self.frames < 1:
            raise InputError(
                "--scenes, --rounds, --nist, --esogu, --random, --seed: not negative; --frames: 1"
            )
        if self.steps < 1 or (self.workers is not None and self.workers < 1):
            raise InputError(f"--steps {self.steps} --workers {self.workers}: give at least 1")
        make_classifier(self.labels, self.weights)

    def _frames(self, detector: VictimDetector) -> dict[str, list[People]]:
        """By lighting."""
        arenas = recipe(self.seed, self.frames)
        result: dict[str, list[People]] = {light.name: [] for light in Lighting if self.scenes}
        for index in track(range(self.scenes), "frames", transient=True):
            for light in Lighting:
                result[light.name] += scene_frames(arenas, index, light, detector)
        return result

    def _episodes(self) -> tuple[dict[str, float], dict[str, Any]]:
        """Figures by group, and what failed."""
        jobs = list(self._jobs())
        if not jobs:
            return {}, {}
        found = _run(jobs, self.runs, self.workers or cores())
        bare = [replace(job, config=replace(job.config, detector=None)) for job in jobs if self.without]
        others = _run(bare, self.runs / "without", self.workers or cores()) if bare else []
        figures: dict[str, float] = {}
        for group in dict.fromkeys(job.group for job in jobs):
            members = [number for number, job in enumerate(jobs) if job.group == group]
            figures |= _figures(group, [found[n] for n in members], [others[n] for n in members if others])
        told = {"failed": [job.name for job, result in zip(jobs, found, strict=True) if result is None]}
        return figures, told

    def _jobs(self) -> Iterator[Job]:
        """The episodes, the longest first."""
        seeds = islice((seed for seed in count() if seed % 4 != 3), self.random)
        arenas = [("esogu_52x15", "esogu_52x15", seed) for seed in range(self.esogu)]
        arenas += [("random", f"random:{seed}", seed) for seed in seeds]
        arenas += [("nist_6x4", "nist_6x4", seed) for seed in range(self.nist)]
        for group, arena, seed in arenas:
            config = EpisodeConfig(
                arena=arena,
                seed=seed,
                steps=self.steps,
                labels=self.labels,
                weights=self.weights,
                simulation=self.simulation,
                detector=self.detector,
            )
            yield Job(group, "ours", config)


LOWEST_CONFIDENCE = 0.01
"""Average precision is of all thresholds."""
_BOUNDS = {"distance": DISTANCES, "hidden": HIDDEN}
"""What average precision is told apart by."""


def _run(jobs: list[Job], folder: Path, workers: int) -> Results:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--runs {folder}: {error.strerror or error}") from error
    return run_jobs(jobs, folder, workers)


def _figures(group: str, found: Results, without: Results) -> dict[str, float]:
    """Of one group: every key of ``victims``, the shares that count, and the time beside episodes without."""
    told = [result for result in found if result and "report" in result]
    reports = [{"victims": result["report"]["victims"]} for result in told]
    figures = {f"{group}.runs": float(len(told))}
    figures |= {f"{group}.{key}": value for key, value in group_figures(reports).items()}
    visible = figures.get(f"{group}.victims.visible.sum", 0)
    if visible:
        figures[f"{group}.visible_found_share"] = figures[f"{group}.victims.visible_found.sum"] / visible
    errors = [error for result in told for error in result["position_errors"]]
    if errors:
        figures[f"{group}.position_error_m.median"] = float(np.median(errors))
    return figures | _times(group, found, without)


def _times(group: str, found: Results, without: Results) -> dict[str, float]:
    """How many times as long it takes with the detector to see 90 %, and to end: medians over the arenas."""
    pairs = [
        (ours["report"], theirs["report"])
        for ours, theirs in zip(found, without, strict=False)
        if ours and theirs and "report" in ours and "report" in theirs
    ]
    ratios: Mapping[str, list[float]] = {
        "sim_time_vs_without": [a["sim_time_s"] / b["sim_time_s"] for a, b in pairs],
        "seen90_vs_without": [
            a["exploration"]["seen90_s"] / b["exploration"]["seen90_s"]
            for a, b in pairs
            if "seen90_s" in a["exploration"] and "seen90_s" in b["exploration"]
        ],
    }
    return {f"{group}.{name}": float(np.median(values)) for name, values in ratios.items() if values}


ROWS: Mapping[str, str] = {
    "episodes": "runs",
    "victims": "victims.present.sum",
    "found": "victims.found.sum",
    "visible within 3.5 m": "victims.visible.sum",
    "of these found": "visible_found_share",
    "false alarms an episode": "victims.false_alarms.mean",
    "position error, m, median": "position_error_m.median",
    "time to see 90 %, over that without": "seen90_vs_without",
    "time of the episode, likewise": "sim_time_vs_without",
}


def _table(figures: Mapping[str, float]) -> Table | None:
    """The groups side by side; speed and precision below. None without episodes."""
    groups = [group for group in GROUPS if f"{group}.runs" in figures]
    if not groups:
        return None
    table = Table("", *groups, title="victims")
    for row, key in ROWS.items():
        table.add_row(row, *(_told(figures.get(f"{group}.{key}")) for group in groups))
    general = {k: v for k, v in figures.items() if k.split(".")[0] not in GROUPS}
    table.caption = "\n".join(f"{name} {value:.4g}" for name, value in general.items())
    return table


def _told(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}"
