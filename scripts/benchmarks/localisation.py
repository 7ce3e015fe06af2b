"""Localisation on recorded drives, against odometry, KISS-ICP and Open3D's RGB-D odometry.

All methods get the same frames, in turn, in a single-threaded process; processor time is measured.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from pipeline.errors import InputError
from sarsim.settings import EpisodeConfig
from scripts.benchmarks.common import Result, at_least
from scripts.benchmarks.episodes import GROUPS, Job, configs, run_jobs
from scripts.benchmarks.exploration_table import Rows, group_figures, groups_in, reports, rich_table, rows_of
from scripts.benchmarks.localisation_drives import DriveJob, record_job
from scripts.benchmarks.localisation_kidnappings import OUTCOMES, kidnap
from scripts.benchmarks.localisation_replay import replay_job
from scripts.benchmarks.settings import LocalisationSettings

OURS, PEERS = ("ours", "ours_without_loops"), ("odometry", "kiss_icp", "open3d")
REGISTERING = PEERS[1:]
NEEDED = ("evo", "kiss_icp")  # Packages that come with ``pip install -e '.[dev]'``
KIDNAPPED_IN = {"nist_6x4": "nist_6x4", "random": "random:1"}
"""The arena in which the robot is kidnapped, by group."""
METHOD_ROWS: Mapping[str, str] = {
    "ATE, m, median": "ate_m.median",
    "ATE, m, worst": "ate_m.worst",
    "heading, °, median": "heading_deg.median",
    "drift, %, median": "drift_percent.median",
    "error over 1 m, m, median": "rpe_m.median",
    "error over 1 m, °, median": "rpe_deg.median",
    "time of a frame, ms": "frame_ms.median",
}
"""Names of each method's table rows, and the figures in them."""


def measure(settings: LocalisationSettings) -> Result:
    """Record the missing drives, and replay all of them.

    Raises:
        InputError: there is nothing to drive, a package is missing, or a folder cannot be used.
    """
    at_least(0, settings, "nist", "esogu", "random", "kidnappings")
    at_least(1, settings, "frames", "workers")
    if missing := [name for name in NEEDED if find_spec(name) is None]:
        are = "is" if len(missing) == 1 else "are"
        raise InputError(f"{' and '.join(missing)} {are} not installed; run: pip install -e '.[dev]'")
    base = EpisodeConfig(labels="truth", detector=None, odometry="truth", lighting=settings.lighting)
    jobs = [
        DriveJob(group, "ours", replace(config, seed=seed), settings.frames)
        for group, config in configs(base, settings, settings.raf)
        for seed in settings.seeds or (config.seed,)
    ]
    jobs = list(dict.fromkeys(jobs))  # Several episodes in one arena yield the same jobs if seeds are given
    kidnappings, runs, workers = settings.kidnappings, settings.runs, settings.workers
    if not jobs and not kidnappings:
        raise InputError(
            "no arenas to drive in; set --nist, --esogu, --random or --kidnappings above 0, or give --raf"
        )
    drives = dict(zip(jobs, run_jobs(jobs, runs, workers, record_job), strict=True))
    recorded = [job for job, drive in drives.items() if drive and "frames" in drive]
    replayed = _replay(recorded, runs, workers, settings.baselines)
    details: dict[str, Any] = {
        "left_out": {job.config.arena: r["left_out"] for job, r in drives.items() if r and "left_out" in r},
        "failed": [job.name for job in jobs if not drives[job] or (job in replayed and not replayed[job])],
        "worst": _worst(replayed),
        "drives": {job.name: result["report"] for job, result in replayed.items() if result},
    }
    figures = figures_of(replayed) | _kidnapped(base, kidnappings, runs)
    pictures = tuple(runs / "replays" / f"{name}.png" for name in details["worst"].values())
    return Result(figures, details, _table(figures, details), pictures)


def _replay(jobs: Sequence[Job], runs: Path, workers: int | None, peers: bool) -> dict[Job, dict[str, Any] | None]:
    """The result of every drive. Earlier results are deleted, because older code may have produced them."""
    folder = runs / "replays"
    for job in jobs:
        (folder / f"{job.name}.json").unlink(missing_ok=True)
    names = (*OURS, *(PEERS if peers else ()))
    return dict(zip(jobs, run_jobs(jobs, folder, workers, replay_job, runs, names), strict=True))


def figures_of(replayed: Mapping[Job, Mapping[str, Any] | None]) -> dict[str, float]:
    """All figures of every group, the ratios to the peers, and the figures over all drives."""
    figures: dict[str, float] = {}
    for group in GROUPS:
        scored = reports([result for job, result in replayed.items() if job.group == group])
        if not scored:
            continue
        figures[f"{group}.runs"] = len(scored)
        figures |= {f"{group}.{key}": value for key, value in group_figures(scored).items()}
        for peer in PEERS:
            if (ate := figures.get(f"{group}.{peer}.ate_m.median")) is not None:
                figures[f"{group}.{peer}_vs_ours"] = ate / figures[f"{group}.ours.ate_m.median"]
    return figures | _overall(reports(list(replayed.values())))


def _overall(scored: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Times, loops and NEES over all drives."""
    figures: dict[str, float] = {}
    for key in ("keyframe_ms", "correction_ms", "nees", "within_3_sigma"):
        if values := [report["ours"][key] for report in scored if key in report["ours"]]:
            figures[f"ours.{key}" if key.endswith("ms") else key] = float(np.median(values))
    for key in ("loops", "false_loops"):
        if values := [report["ours"][key] for report in scored if key in report["ours"]]:
            figures[key] = float(sum(values))
    for peer in REGISTERING:
        both = [r for r in scored if peer in r and "keyframe_ms" in r["ours"]]
        if both:
            ratios = [r[peer]["frame_ms"] / r["ours"]["keyframe_ms"] for r in both]
            figures[f"{peer}_vs_ours_time"] = float(np.median(ratios))
    return figures


def _kidnapped(base: EpisodeConfig, times: int, runs: Path) -> dict[str, float]:
    """Number of kidnappings with each outcome, out of ``times``, in each arena of ``KIDNAPPED_IN``."""
    figures: dict[str, float] = {}
    for group, arena in KIDNAPPED_IN.items() if times else ():
        config = replace(base, arena=arena, odometry="wheel")
        for outcome, count in kidnap(config, times, runs / f"kidnapped-{group}").items():
            figures[f"{group}.kidnapped.{outcome}"] = float(count)
    return figures


def _worst(replayed: Mapping[Job, Mapping[str, Any] | None]) -> dict[str, str]:
    """The name of the drive with our largest ATE, by group."""
    worst: dict[str, tuple[float, str]] = {}
    for job, result in replayed.items():
        if result:
            worst[job.group] = max(worst.get(job.group, (0.0, "")), (result["report"]["ours"]["ate_m"], job.name))
    return {group: name for group, (_, name) in worst.items()}


def sections_of(figures: Mapping[str, float]) -> list[Rows]:
    """The table's sections: the drives, each method, the kidnappings, and the ratios."""
    sections = [rows_of(figures, {"drives": "runs", "path length of a drive, m, median": "way_m.median"})]
    for method in (*OURS, *PEERS):
        rows = {f"{method.replace('_', ' ')}: {row}": f"{method}.{key}" for row, key in METHOD_ROWS.items()}
        sections.append(rows_of(figures, rows))
    sections.append(
        rows_of(figures, {f"kidnapped: {name.replace('_', ' ')}": f"kidnapped.{name}" for name in OUTCOMES})
    )
    ratios = {f"ATE of {peer.replace('_', ' ')} over ours": f"{peer}_vs_ours" for peer in PEERS}
    return [*sections, rows_of(figures, ratios)]


def drive_line(name: str, ours: Mapping[str, float]) -> str:
    """A line of text with the figures of our localisation on one drive."""
    line = f"{name}: ATE {ours['ate_m']:.3f} m, worst {ours['max_m']:.3f} m"
    if "nees" in ours:
        line += f", NEES {ours['nees']:.2f}, within 3 σ {ours['within_3_sigma']:.1%}"
    return f"{line}, false loops {ours['false_loops']:.0f} of {ours['loops']:.0f}"


def _table(figures: Mapping[str, float], details: Mapping[str, Any]) -> Table:
    """A table with a section for each method; its caption has the figures over all drives."""
    table = rich_table("localisation", figures, sections_of(figures))
    lines = [f"{name} {value:.4g}" for name, value in figures.items() if name.split(".")[0] not in groups_in(figures)]
    lines += [drive_line(name, report["ours"]) for name, report in details["drives"].items()]
    lines += [f"{arena} skipped: {reason}" for arena, reason in details["left_out"].items()]
    lines += [f"{name} failed; see its log" for name in details["failed"]]
    table.caption = "\n".join(lines)
    return table
