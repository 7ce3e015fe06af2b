"""What a command prints of the results that it leaves."""

import os
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from pipeline.rescue_report.figures import figures

SKIPPED = ("config", "timing_ms")


def report_table(report: dict[str, Any]) -> Table:
    """A table with a row for every figure of report.json, without the settings; one section per stage."""
    table = Table("figure", title=f"{report['arena']}, seed {report['seed']}")
    table.add_column("value", justify="right")
    for stage, content in report.items():
        if stage in SKIPPED:
            continue
        if stage == "finds":  # kinds that are neither there nor reported have no figures
            content = {kind: scores for kind, scores in content.items() if any(scores.values())}
        for name, value in figures(stage, content):
            table.add_row(name, f"{value:,.4g}" if isinstance(value, float) else str(value))
        if isinstance(content, dict):
            table.add_section()
    return table


def show_results(report: dict[str, Any], folder: Path) -> None:
    """Print what report.json holds, if anything, and how to look at the files of a run."""
    console = Console()
    if report:
        console.print(report_table(report))
    viewer = os.path.relpath(Path(sys.executable).with_name("sarsim-view"))
    console.print(f"Results in {folder}; to look at the recording: {viewer} {folder}", soft_wrap=True)
    if (folder / "report.html").exists():
        console.print(f"The page for rescuers: {folder / 'report.html'}", soft_wrap=True)
