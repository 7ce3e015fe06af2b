"""Exploration over many arenas, beside two baselines: the nearest frontier with straight lines, and a random walk.

Every episode is one process of one thread. What it finds out stays in a folder, so that a long run can be interrupted
and continued.
"""

import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count, islice, product
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tyro

from pipeline.errors import InputError
from sarsim.episode import WEIGHTS, EpisodeConfig, Labels, make_classifier
from sarsim.scripts.benchmarks.exploration_episode import Job, Strategy
from sarsim.scripts.benchmarks.exploration_figures import group_figures, seen90_ratio
from sarsim.scripts.benchmarks.exploration_processes import cores, run_jobs
from sarsim.scripts.benchmarks.exploration_table import GROUPS, RATIO, rich_table
from sarsim.scripts.benchmarks.subject import Result, Subject
from sarsim.simulated_robot import SimulationConfig

BASELINE_STAGES = ("sim_time_s", "steps", "navigation", "exploration")
"""What is told of the baselines."""

Runs = Mapping[tuple[str, Strategy], Sequence[dict[str, Any] | None]]
"""Results by group and strategy, None where a process failed."""


@dataclass(frozen=True)
class ExplorationBenchmark(Subject):
    """Exploration, driving and topological map over many arenas, beside two baselines."""

    nist: int = 10
    """Seeds in nist_6x4."""
    esogu: int = 2
    """Seeds in esogu_52x15."""
    raf: Path | None = None
    """Folder of .raf arenas; those in which the robot can be set down are explored once each."""
    raf_files: int | None = None
    """So many of them, in the order of their names; if not given, all."""
    random: int = 30
    """Random arenas, of difficulties 0, 1 and 2."""
    baselines: tuple[Literal["nearest_frontier", "random_walk"], ...] = ("nearest_frontier", "random_walk")
    """What to compare with."""
    steps: int = 1000
    """Looks at most; an episode ends before when nothing is left to look at."""
    labels: Labels = "dgcnn"
    """Who says what a point belongs to: the network, or the simulator."""
    weights: Path = WEIGHTS
    """Of the network."""
    detector: tuple[Path, Path] | None = EpisodeConfig.detector
    """Of victims, whom only the robot itself looks for; None to look for nobody."""
    simulation: Annotated[SimulationConfig, tyro.conf.arg(name="")] = field(default_factory=SimulationConfig)
    """Of the robot's body."""
    """Settings of every stage."""
    workers: int | None = None
    """Episodes at a time; if not given, as many as there are cores."""
    runs: Path = Path("runs/benchmark-exploration")
    """Folder for what each episode finds out; those that are there already are not run again."""
    pictures: int = 2
    """Of the worst runs of each group, beside the file that --json names, or else in --runs."""

    def measure(self) -> Result:
        """Run what has not been run yet, and sum up.

        Raises:
            InputError: nothing is to be run, or a folder cannot be had.
        """
        jobs = list(self._jobs())
        try:
            self.runs.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"--runs {self.runs}: {error.strerror or error}") from error
        results = run_jobs(jobs, self.runs, self.workers or cores())
        runs = {
            (group, strategy): [
                result
                for job, result in zip(jobs, results, strict=True)
                if (job.group, job.strategy) == (group, strategy)
            ]
            for group, strategy in dict.fromkeys((job.group, job.strategy) for job in jobs)
        }
        figures, details = _figures(runs), self._details(jobs, results)
        table = rich_table(figures, self.baselines)
        table.caption = _caption(figures, details)
        return Result(figures, details, table)

    def _jobs(self) -> Iterator[Job]:
        """The episodes, the longest first."""
        self._check()
        strategies: tuple[Strategy, ...] = ("ours", *self.baselines)
        for (group, arena, seed), strategy in product(self._arenas(), strategies):
            config = EpisodeConfig(
                arena=arena,
                seed=seed,
                steps=self.steps,
                labels=self.labels,
                weights=self.weights,
                detector=self.detector if strategy == "ours" else None,
                simulation=self.simulation,
            )
            yield Job(group, strategy, config)

    def _check(self) -> None:
        if min(self.nist, self.esogu, self.random, self.pictures, self.raf_files or 0) < 0:
            raise InputError("--nist, --esogu, --random, --raf-files and --pictures cannot be negative")
        if self.steps < 1 or (self.workers is not None and self.workers < 1):
            raise InputError(f"--steps {self.steps} --workers {self.workers}: give at least 1")
        if self.raf is not None and not any(self.raf.glob("*.raf")):
            raise InputError(f"--raf {self.raf}: no .raf file is there")
        if not any(self._arenas()):
            raise InputError("no arena is to be explored")
        make_classifier(self.labels, self.weights)

    def _arenas(self) -> Iterator[tuple[str, str, int]]:
        """Group, arena and seed of each pair of arena and seed."""
        yield from (("esogu_52x15", "esogu_52x15", seed) for seed in range(self.esogu))
        files = sorted(self.raf.glob("*.raf")) if self.raf else []
        yield from (("raf", str(file), 0) for file in files[: self.raf_files])
        # A random arena's difficulty is the remainder of its seed on division by 4.
        seeds = islice((seed for seed in count() if seed % 4 != 3), self.random)
        yield from (("random", f"random:{seed}", seed) for seed in seeds)
        yield from (("nist_6x4", "nist_6x4", seed) for seed in range(self.nist))

    def _details(self, jobs: Sequence[Job], results: Sequence[dict[str, Any] | None]) -> dict[str, Any]:
        """What does not fit into numbers."""
        told = dict(zip(jobs, results, strict=True))
        return {
            "left_out": {job.config.arena: r["left_out"] for job, r in told.items() if r and "left_out" in r},
            "failed": [job.name for job, result in told.items() if result is None],
            "worst": self._worst(told),
        }

    def _worst(self, told: Mapping[Job, dict[str, Any] | None]) -> dict[str, list[str]]:
        """The names of the worst runs of ours in each group; their pictures go beside the figures."""
        worst: dict[str, list[str]] = {}
        for group in GROUPS:
            reports = {
                job.name: r["report"]
                for job, r in told.items()
                if r and "report" in r and (job.group, job.strategy) == (group, "ours")
            }
            chosen = sorted(reports, key=lambda name: _goodness(reports[name]))[: self.pictures]
            if chosen:
                worst[group] = chosen
        if self.json:
            for name in (name for names in worst.values() for name in names):
                shutil.copyfile(
                    self.runs / f"{name}.png", self.json.with_name(f"{self.json.stem}-{name}.png")
                )
        return worst


def _goodness(report: Mapping[str, Any]) -> tuple[float, ...]:
    """By which runs are compared: first whether the robot tipped, then what it saw, then what it touched."""
    navigation = report["navigation"]
    return -navigation["tipped"], report["exploration"]["explored_fraction"], -navigation["collisions"]


def _reports(runs: Runs, group: str, strategy: Strategy) -> list[dict[str, Any]]:
    return [r["report"] for r in runs.get((group, strategy), ()) if r and "report" in r]


def _ratios(runs: Runs, group: str) -> list[float]:
    """Of the pairs in which the nearest frontier's robot saw enough."""
    pairs = zip(runs.get((group, "ours"), ()), runs.get((group, "nearest_frontier"), ()), strict=False)
    ratios = [
        seen90_ratio(ours["report"], theirs["report"])
        for ours, theirs in pairs
        if ours and theirs and "report" in ours and "report" in theirs
    ]
    return [ratio for ratio in ratios if ratio is not None]


def _figures(runs: Runs) -> dict[str, float]:
    """Every figure of every group, those of the baselines after their name."""
    figures: dict[str, float] = {}
    for group, strategy in runs:
        reports = _reports(runs, group, strategy)
        prefix = group if strategy == "ours" else f"{strategy}.{group}"
        if strategy != "ours":
            reports = [{stage: report[stage] for stage in BASELINE_STAGES} for report in reports]
        figures[f"{prefix}.runs"] = len(reports)
        figures[f"{prefix}.failed"] = sum(result is None for result in runs[group, strategy])
        figures[f"{prefix}.seen90_runs"] = sum("seen90_s" in r["exploration"] for r in reports)
        figures |= {f"{prefix}.{key}": value for key, value in group_figures(reports).items()}
    ratios = {group: _ratios(runs, group) for group in GROUPS}
    for group, values in ratios.items():
        if values:
            figures[f"{group}.{RATIO}.mean"] = float(np.mean(values))
            figures[f"{group}.{RATIO}.median"] = float(np.median(values))
            figures[f"{group}.{RATIO}.worst"] = max(values)
            figures[f"{group}.{RATIO}.pairs"] = len(values)
    if pairs := [ratio for values in ratios.values() for ratio in values]:
        figures[RATIO] = float(np.median(pairs))
        figures[f"{RATIO}.pairs"] = len(pairs)
    return figures


def _caption(figures: Mapping[str, float], details: Mapping[str, Any]) -> str:
    """What no column tells."""
    told = [f"{arena} left out: {reason}" for arena, reason in details["left_out"].items()]
    told += [f"{name} failed, see its log" for name in details["failed"]]
    if RATIO in figures:
        pairs = figures[f"{RATIO}.pairs"]
        told.append(
            f"time to see 90 % over the nearest frontier's: {figures[RATIO]:.2f}, median of {pairs:.0f}"
        )
    return "\n".join(told)
