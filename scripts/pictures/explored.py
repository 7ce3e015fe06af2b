"""Draw the picture for the results of exploration: the map of every arena, as in the rescue reports of the runs.

This needs Debian's chromium, but no screen.
"""

import json
import math
import re
from pathlib import Path

from pipeline.errors import InputError
from scripts.benchmarks.exploration import GROUND_ONLY, NEAREST_FRONTIER
from scripts.benchmarks.runs import arena_name
from scripts.pictures.layout import BACKGROUND, INK, save
from scripts.pictures.rescue_report import browser_screenshot

COLUMNS, WIDTH, HEIGHT = 5, 300, 250
"""Number of columns of maps; width and height of a map with its caption, pixels."""
STYLE = f"""
body {{ margin: 0; background: rgb{BACKGROUND}; display: grid; grid-template-columns: repeat({COLUMNS}, {WIDTH}px); }}
figure {{ margin: 0; padding: 4px; width: {WIDTH}px; height: {HEIGHT}px; display: flex; flex-direction: column; }}
figcaption {{ color: rgb{INK}; font-size: 15px; overflow: hidden; white-space: nowrap; }}
.drawing {{ flex: 1; min-height: 0; background: rgb{BACKGROUND}; }}
.drawing .unknown, .tick, .number, .label {{ display: none; }}
"""


def draw(results: Path) -> None:
    """Draw the maps of the newest ``exploration-COMMIT`` in a folder, in ascending order of the explored fraction."""
    folders = [folder for folder in results.glob("exploration-*") if any(folder.glob("*.html"))]
    if not folders:
        raise InputError(f"{results}: has no runs; run: make results PAGE=exploration")
    folder = max(folders, key=lambda folder: folder.stat().st_mtime)
    runs = {file: json.loads(file.with_suffix(".json").read_text()) for file in folder.glob("*.html")}
    own = [run for run in runs if not run.name.startswith((GROUND_ONLY, NEAREST_FRONTIER))]
    explored = {run: runs[run]["report"]["exploration"]["explored_fraction"] for run in own}
    own.sort(key=lambda run: (explored[run], run.name))
    figures = "".join(
        f"<figure><figcaption>{arena_name(runs[run]['report']['arena'])}: {explored[run]:.1%}</figcaption>"
        f"{map_svg(run.read_text())}</figure>"
        for run in own
    )
    style = re.findall(r"<style>(.*?)</style>", own[0].read_text(), re.DOTALL)[0]
    page = f"<!DOCTYPE html><meta charset='utf-8'><style>{style}{STYLE}</style>{figures}"
    save("explored-arenas.jpg", browser_screenshot(page, COLUMNS * WIDTH, math.ceil(len(own) / COLUMNS) * HEIGHT), 80)


def map_svg(page: str) -> str:
    """The SVG of the map on a report's page."""
    return re.findall(r'<svg [^>]*class="drawing".*?</svg>', page, re.DOTALL)[0]
