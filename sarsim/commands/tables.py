"""The lines and tables that commands print about their results."""

import os
import shutil
import sys
from collections.abc import Mapping
from math import floor
from pathlib import Path
from shlex import quote
from typing import Any

from rich.console import Console
from rich.table import Table

from pipeline.rescue_report.figures import figures

SKIPPED = ("config", "timing_ms")
VIEW = "sarsim-view"
MIN_DRIVEN = 0.05  # m; a robot that has driven less has only turned in place
ENDED_TEXTS = {
    "nothing_left": "nothing was left to explore",
    "not_worth_it": "no remaining viewpoint was worth the drive",
    "unreachable": "no path led to the chosen viewpoint",
    "held": "the robot could not move",
    "shut_in": "the robot was enclosed by obstacles",
    "lost": "the robot lost track of its position",
    "interrupted": "interrupted",
    "time": "the time limit was reached",
    "steps": "the step limit was reached",
}
"""Reasons for the end of exploration, as text, by the value of ``exploration.ended``."""


def report_table(report: dict[str, Any]) -> Table:
    """A table with a row for every figure of report.json, without the settings; one section per stage."""
    table = Table("figure", title=f"{report['arena']}, seed {report['seed']}")
    table.add_column("value", justify="right")
    for stage, content in report.items():
        if stage in SKIPPED:
            continue
        if stage == "finds":  # kinds that are neither present nor reported have no figures
            content = {kind: scores for kind, scores in content.items() if any(scores.values())}
        for name, value in figures(stage, content):
            table.add_row(name, f"{value:,.4g}" if isinstance(value, float) else str(value))
        if isinstance(content, dict):
            table.add_section()
    return table


def summary(report: Mapping[str, Any]) -> dict[str, str]:
    """The outcome of a run, a few words per topic; topics without figures in the report are left out."""
    lines = {
        "explored": _explored(report),
        "legs": _legs(report),
        "pose": _pose(report.get("localisation", {})),
        "labels": _labels(report.get("semantic_map", {})),
        "people": _people(report.get("victims", {})),
    }
    return {about: line for about, line in lines.items() if line}


def _explored(report: Mapping[str, Any]) -> str:
    exploration = report.get("exploration", {})
    lasted = f"{_counted(report['steps'], 'step')} in {_clock(report['sim_time_s'])} of the robot's time"
    share = exploration.get("explored_fraction")
    seen = f"{_percent(share)} of the drivable ground, " if share is not None else ""
    points = [
        f"{name} {report[name]['total']['points']:.4g} points" for name in ("league", "virtual") if name in report
    ]
    ended = [ENDED_TEXTS.get(exploration["ended"], exploration["ended"])] if "ended" in exploration else []
    return "; ".join([f"{seen}{lasted}", *ended, *points])


def _legs(report: Mapping[str, Any]) -> str:
    driven, goals, faults = report.get("navigation"), report.get("goals"), report.get("faults")
    parts = []
    if driven:
        way = driven["distance_m"]
        parts += [f"{driven['reached']} of {driven['legs']} reached"]
        parts += [f"{way:.1f} m driven" if way >= MIN_DRIVEN or not driven["legs"] else "turning in place alone"]
        parts += [_counted(driven["collisions"], "contact") + " with walls, clutter or people"]
        if people := driven.get("person_contacts"):
            parts += [f"{people} of them with people"]
        parts += ["the robot tipped over"] if driven["tipped"] else []
    if goals:
        parts += [f"{goals['reached']} of {goals['given']} goals reached"]
    return ", ".join(parts + ([_counted(len(faults), "fault") + " detected"] if faults else []))


def _pose(localisation: Mapping[str, Any]) -> str:
    if localisation.get("ate_rmse_m") is None:
        return ""
    return f"{100 * localisation['ate_rmse_m']:.1f} cm and {localisation['heading_rmse_deg']:.2f}° off (RMS)"


def _labels(semantic_map: Mapping[str, Any]) -> str:
    if semantic_map.get("accuracy") is None:
        return ""
    miou = semantic_map.get("miou_four")
    mean = f"; mean IoU of walls, ground, slopes and decks {miou:.3f}" if miou is not None else ""
    return f"{_percent(semantic_map['accuracy'])} of {semantic_map['points']:,} points correct{mean}"


def _people(victims: Mapping[str, Any]) -> str:
    if not victims:
        return ""
    error, alarms = victims["position_error_m"], _counted(victims["false_alarms"], "false alarm")
    off = f", {100 * error:.0f} cm off" if error is not None else ""
    return f"{victims['found']} of {victims['present']} found{off}, {alarms}"


def _counted(count: int, what: str) -> str:
    return f"{count or 'no'} {what}{'s' * (count != 1)}"


def _percent(fraction: float) -> str:
    """A fraction as text, rounded down, so that 100% means all."""
    return f"{floor(1e3 * fraction) / 10:g}%"


def _clock(seconds: float) -> str:
    return f"{round(seconds) // 60}:{round(seconds) % 60:02d} min"


def show_results(report: dict[str, Any], folder: Path, every_figure: bool = False) -> None:
    """Print the outcome of a run, if there is one, and how to view its files."""
    console = Console(highlight=False, markup=False)
    if report and every_figure:
        console.print(report_table(report))
    lines = summary(report) if report else {}
    page = folder / "report.html"
    files = [f"{folder}", f"recording: {_viewer()} {quote(str(folder))}"]
    files += [f"report page: python3 -m webbrowser {quote(str(page))}"] if page.exists() else []
    for about, line in {**lines, "results": "; ".join(files)}.items():
        console.print(f"{about:9} {line}", soft_wrap=True)


def _viewer() -> str:
    """The command that opens a recording, as typed in the current folder."""
    installed = Path(sys.executable).with_name(VIEW)
    on_path = shutil.which(VIEW)
    if on_path and (not installed.exists() or Path(on_path).samefile(installed)):
        return VIEW
    return os.path.relpath(installed)
