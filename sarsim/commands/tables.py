"""Reports as readable tables."""

from typing import Any

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
