"""Figures as tables."""

from collections.abc import Iterator, Mapping
from typing import Any

from pipeline.rescue_report.markup import Markup, element

RUN = ("arena", "seed", "steps", "version", "sim_time_s", "wall_time_s", "real_time_factor", "timing_ms")
"""Parts of report.json that say what ran and how long it took; all others but the settings need the truth."""
SETTINGS = "config"


def run_figures(report: Mapping[str, Any]) -> Markup:
    """What ran and how long it took."""
    return _table({key: report[key] for key in RUN if key in report})


def scores(report: Mapping[str, Any]) -> Markup:
    """What was measured against the truth."""
    return _table({key: value for key, value in report.items() if key not in (*RUN, SETTINGS)})


def settings(report: Mapping[str, Any]) -> Markup:
    """All settings."""
    return _table(report.get(SETTINGS, {}))


def _table(content: Mapping[str, Any]) -> Markup:
    rows = (
        element("tr", element("th", name, scope="row"), element("td", _told(value)))
        for key, part in content.items()
        for name, value in flat(key, part)
    )
    return element("table", element("tbody", *rows))


def flat(name: str, content: Any) -> Iterator[tuple[str, Any]]:
    """The values in nested mappings, with their path as name."""
    if not isinstance(content, Mapping):
        yield name, content
        return
    for key, value in content.items():
        yield from flat(f"{name}.{key}", value)


def _told(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}".replace("-", "−")
    return "not given" if value is None else str(value)
