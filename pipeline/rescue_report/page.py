"""The page: the robot's knowledge as one self-contained HTML file."""

from collections.abc import Mapping
from datetime import datetime
from pathlib import PurePath
from typing import Any

import numpy as np

from pipeline.html_page import render
from pipeline.labels import PERSON_COLOUR, PLAIN_NAMES, Label
from pipeline.rescue_report.figures import figures
from pipeline.rescue_report.map_drawing import classes_from_above, draw_map, pale_colour
from pipeline.rescue_report.records import people_data
from pipeline.rescue_report.scores import league_scores
from pipeline.rescue_report.situation import Situation
from pipeline.rescue_report.words import FILTERS
from pipeline.tracks.find import plain_text

RUN_KEYS = ("arena", "seed", "steps", "version", "sim_time_s", "wall_time_s", "real_time_factor", "timing_ms")
"""Parts of report.json that describe the run and its duration; all others except settings are shown as scores."""
SETTINGS_KEY = "config"


def page(situation: Situation, report: Mapping[str, Any], written: datetime | None = None) -> str:
    """The page as HTML.

    Args:
        situation: the robot's knowledge at the end of the run.
        report: figures of report.json. Figures that need the ground truth appear only in the last section and among a
            mission's scores, where the page says so.
        written: time of writing, for the head of the page.
    """
    drawn = np.unique(classes_from_above(situation))
    arena = PurePath(str(report["arena"]))  # an arena in a file is named after the file
    return render(
        "pipeline.rescue_report",
        "page.html",
        (plain_text, *FILTERS),
        situation=situation,
        report=report,
        title=arena.stem if arena.suffix.lower() in (".raf", ".xml") else report["arena"],
        map=draw_map(situation),
        classes={PLAIN_NAMES[k]: pale_colour(k) for k in map(Label, drawn[drawn >= 0])},
        people=people_data(situation),
        person_colour=PERSON_COLOUR,
        written=written,
        missions=league_scores(report),
        run=_tables({key: report[key] for key in RUN_KEYS if key in report}, "run"),
        scores=_tables({key: report[key] for key in report if key not in (*RUN_KEYS, SETTINGS_KEY)}, ""),
        settings=_tables(report.get(SETTINGS_KEY, {}), "command"),
    )


def _tables(content: Mapping[str, Any], rest: str) -> dict[str, list[tuple[str, str]]]:
    """The rows of each table, names and values, by the table's caption.

    The first table, whose caption is ``rest``, contains the plain values; each nested mapping has a table of its own.
    """
    nested = {key: value for key, value in content.items() if isinstance(value, Mapping)}
    parts = {rest: {key: content[key] for key in content if key not in nested}, **nested}
    return {
        caption: [(name, _shown(value)) for key in part for name, value in figures(key, part[key])]
        for caption, part in parts.items()
        if part
    }


def _shown(value: Any) -> str:
    """A value as text."""
    if isinstance(value, float):
        return f"{value:.4g}".replace("-", "−")
    return "not given" if value is None else "none" if value == [] else str(value)
