"""The files that every run writes, each by its own sink."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.files import atomic_write, run_all
from pipeline.map_file import save_maps
from pipeline.rerun.recorder import Recorder
from pipeline.rescue_report.report import RescuePage, RescueReport
from pipeline.sink import Result, Sink


class MapFiles(Sink):
    """Writes all maps and the estimated trajectory."""

    finishing = "writing the maps"

    def finish(self, result: Result) -> None:
        """Write each file independently; InputError if one cannot be written."""
        if result.steps:
            run_all(partial(save_maps, result.mapper, result.folder), partial(result.trajectory.save, result.folder))


class ReportFile(Sink):
    """Writes report.json."""

    finishing = "writing report.json"

    def __init__(self, settings: Any, place: str, seed: int):
        """Report on a run.

        ``settings``: dataclass with the settings of the run; ``place``: name of the mapped place; ``seed``: seed of
        all random numbers.
        """
        self._settings, self._place, self._seed = settings, place, seed

    def finish(self, result: Result) -> None:
        """Write the report; after a run without steps, only if the robot was lost. InputError if writing fails."""
        if not result.is_reported:
            return
        stopwatch = result.mapper.stopwatch
        settings = {
            name: value for name, value in asdict(self._settings).items() if name not in ("pipeline", "io", "plugins")
        }
        result.report |= {
            "arena": _plain(self._place),
            "seed": self._seed,
            "steps": result.steps,
            "version": version("sarsim"),
            "config": {name: _plain(value) for name, value in settings.items()}
            | {"out": _plain(result.folder), "plugins": sorted(getattr(self._settings, "plugins", ()))},
            "sim_time_s": result.sim_time,
            "wall_time_s": result.wall_time,
            "real_time_factor": result.sim_time / result.wall_time,
            "timing_ms": {stage: _percentiles(times) for stage, times in stopwatch.seconds.items()},
            **result.figures,
        }
        write_report(result.report, result.folder)


def _plain(value: Any) -> Any:
    """A setting as a value for JSON.

    An absolute path is reduced to its last part, because the rest may reveal the user's name.
    """
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    is_absolute = isinstance(value, str | Path) and Path(value).is_absolute()
    return Path(value).name if is_absolute else str(value) if isinstance(value, Path) else value


def write_report(report: dict[str, Any], folder: Path) -> None:
    """Write report.json; InputError if it cannot be written."""
    with atomic_write(folder / "report.json") as path:
        path.write_text(json.dumps(report, indent=1, default=float, allow_nan=False) + "\n")


def _percentiles(seconds: list[float]) -> dict[str, float]:
    """Median and 95th percentile of durations in s, converted to ms."""
    ms = 1e3 * np.array(seconds)
    return {"median": float(np.median(ms)), "p95": float(np.percentile(ms, 95))}


def result_sinks(
    settings: Any, place: str, seed: int, recorder: Recorder, rescue_report: RescueReport, others: Sequence[Sink] = ()
) -> list[Sink]:
    """The sinks of a run with a results folder, in the order in which they receive the result.

    report.json includes the figures of ``others``, and the page of the rescue report shows the content of
    report.json.
    """
    return [
        MapFiles(),
        rescue_report,
        recorder,
        *others,
        ReportFile(settings, place, seed),
        RescuePage(rescue_report),
    ]
