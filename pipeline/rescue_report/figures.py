"""Figures as tables."""

from collections.abc import Iterator, Mapping
from typing import Any

from pipeline.rescue_report.markup import Markup, element

RUN = ("arena", "seed", "steps", "version", "sim_time_s", "wall_time_s", "real_time_factor", "timing_ms")
"""Parts of report.json that say what ran and how long it took; all others but the settings need the truth."""
SETTINGS = "config"


def run_figures(report: Mapping[str, Any]) -> Markup:
    """What ran and how long it took."""
    return _tables({key: report[key] for key in RUN if key in report}, "run")


def scores(report: Mapping[str, Any]) -> Markup:
    """What was measured against the truth."""
    return _tables({key: value for key, value in report.items() if key not in (*RUN, SETTINGS)}, "")


def settings(report: Mapping[str, Any]) -> Markup:
    """All settings."""
    return _tables(report.get(SETTINGS, {}), "command")


def _tables(content: Mapping[str, Any], rest: str) -> Markup:
    """A table for every part that has parts itself, after one called ``rest`` for the others."""
    parts: dict[str, Mapping[str, Any]] = {
        rest: {key: value for key, value in content.items() if not isinstance(value, Mapping)}
    }
    parts |= {key: value for key, value in content.items() if isinstance(value, Mapping)}
    return element("div", *(_table(name, part) for name, part in parts.items() if part), class_="figures")


def _table(name: str, content: Mapping[str, Any]) -> Markup:
    rows = (
        element("tr", element("th", key, scope="row"), element("td", _told(value)))
        for first, part in content.items()
        for key, value in flat(first, part)
    )
    return element("table", element("caption", name), element("tbody", *rows))


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
