"""Finds: how many of each kind the robot finds and reads in complete episodes, or what is found in real photos."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pipeline.tracks.find import FIND_KINDS, VICTIM
from pipeline.victims.detection.detector import VictimDetector
from sarsim.methods.perception import shipped_readers
from scripts.benchmarks.common import Result, at_least
from scripts.benchmarks.episodes import Job, configs, run_jobs
from scripts.benchmarks.finds_photos import photo_figures
from scripts.benchmarks.settings import FindsSettings


def measure(settings: FindsSettings) -> Result:
    """Shares found and read, false alarms per episode and position errors by kind; for photos, only ``real.*``.

    Raises:
        InputError: a number is too low, a network is broken, or a folder cannot be used.
    """
    readers = shipped_readers(settings)
    if settings.photos is not None:
        assert readers is not None
        return Result(photo_figures(settings.photos, VictimDetector.load(*settings.detector), readers))
    at_least(0, settings, "nist", "esogu", "random", "things")
    at_least(1, settings, "workers")
    jobs = [Job(group, "ours", config) for group, config in configs(settings.episode, settings)]
    results = run_jobs(jobs, settings.runs, settings.workers)
    failed = [job.name for job, result in zip(jobs, results, strict=True) if result is None]
    return Result(figures_of([result for result in results if result and "report" in result]), {"failed": failed})


def figures_of(results: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Figures by kind: share ``found`` of the visible, share ``read`` of the found, and false alarms per episode."""
    figures = {"runs": float(len(results))}
    for kind in (VICTIM, *FIND_KINDS):
        reports = [r["report"]["victims"] if kind == VICTIM else r["report"]["finds"].get(kind) for r in results]
        present = [report for report in reports if report]
        visible, found = (sum(report[key] for report in present) for key in ("visible", "found"))
        if present:
            figures[f"{kind}.visible"] = float(visible)
            figures[f"{kind}.false_alarms"] = sum(report["false_alarms"] for report in present) / len(present)
        if visible:
            figures[f"{kind}.found"] = sum(report["visible_found"] for report in present) / visible
        if found and kind != VICTIM:
            figures[f"{kind}.read"] = sum(report["read"] for report in present) / found
        errors = [r["position_errors"] if kind == VICTIM else r["find_errors"].get(kind, []) for r in results]
        if every := [error for some in errors for error in some]:
            figures[f"{kind}.position_error_m.median"] = float(np.median(every))
    return figures
