"""The page of a sweep: each method's explored fraction over time and distance, and the leaderboard's tables."""

from collections.abc import Iterator, Mapping, Sequence
from io import StringIO
from itertools import cycle, product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pipeline.arrays import Values
from pipeline.html_page import render, write_html
from sarsim.commands.sweeps.leaderboard import END_KEYS, Entry, boards
from sarsim.commands.sweeps.statistics import estimate
from sarsim.scoring.progress import ExploredCurve, fractions_at

AXES = {"time_s": ("time, s", END_KEYS["time"]), "way_m": ("path length, m", END_KEYS["way"])}
"""Axes of the plots: for each field of a curve, the axis's label and the report key of its value at the end."""
SAMPLES = 101
"""Number of points along an axis at which fractions are drawn, a hundredth of the axis apart."""
OKABE_ITO = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000", "#F0E442")
"""Colours that colour-blind people can distinguish (Okabe and Ito, 2008); the faintest comes last."""
DASHES = ("", "6 2", "2 2")
"""Lengths in points of dashes and gaps, which distinguish lines of the same colour."""


class Stroke(NamedTuple):
    """Style of a method's line: its colour, and the lengths in points of its dashes and gaps."""

    colour: str
    dashes: str


Curves = Mapping[str, Sequence[ExploredCurve]]
"""For each method, the curves of its episodes, arena by arena and, in each arena, seed by seed."""


def write_page(entries: Sequence[Entry], curves: Curves, path: Path) -> None:
    """Write the page of entries for the same arenas and seeds; InputError if it cannot be written."""
    strokes = dict(zip(curves, _strokes(), strict=False))
    plots = plots_svg(entries, curves, strokes)
    found = list(boards(entries))
    write_html(path, render("sarsim.commands.sweeps", "sweep.html", plots=plots, strokes=strokes, boards=found))


def _strokes() -> Iterator[Stroke]:
    """An endless sequence of strokes; the first ones differ in colour."""
    return cycle(Stroke(colour, dashes) for dashes, colour in product(DASHES, OKABE_ITO))


def plots_svg(entries: Sequence[Entry], curves: Curves, strokes: Mapping[str, Stroke]) -> str:
    """The plots over time and distance as an SVG element; equal arguments give equal bytes."""
    svg, figure = StringIO(), Figure(figsize=(11, 5), layout="constrained")
    with rc_context({"svg.hashsalt": "sweep", "svg.fonttype": "none"}):
        for plot, axis in zip(figure.subplots(1, len(AXES), sharey=True), AXES, strict=True):
            _draw(plot, axis, entries, curves, strokes)
        figure.savefig(svg, format="svg", metadata={"Date": None})
    return svg.getvalue()[svg.getvalue().index("<svg") :]


def _draw(plot: Axes, axis: str, entries: Sequence[Entry], curves: Curves, strokes: Mapping[str, Stroke]) -> None:
    """Draw each method's mean explored fraction, with its interval, up to the end of the longest episode."""
    label, end = AXES[axis]
    longest = max(entry.values(end, 0.0).max() for entry in entries)
    places = np.linspace(0, longest, SAMPLES)
    for entry in entries:
        mean, low, high = band(curves[entry.method], axis, places, len(entry.seeds))
        colour, dashes = strokes[entry.method]
        line = (0, [float(length) for length in dashes.split()]) if dashes else "solid"
        plot.fill_between(places, low, high, facecolor=(colour, 0.12), edgecolor=(colour, 0.5), linewidth=0.5)
        plot.plot(places, mean, color=colour, linestyle=line)
    plot.set(xlabel=label, ylabel="explored fraction", xlim=(0, longest or 1), ylim=(0, 1.01))
    plot.label_outer()
    plot.grid(alpha=0.3)


def band(curves: Sequence[ExploredCurve], axis: str, places: Values, seeds: int) -> NDArray[np.float64]:
    """The interquartile mean of the explored fractions, and the ends of its interval, as in the tables.

    Args:
        curves: curves of the episodes, arena by arena and, in each arena, seed by seed.
        axis: field of the curves along the plot's x-axis.
        places: (P,) points on the axis, s or m; after its end, an episode keeps its last fraction.
        seeds: number of seeds per arena.

    Returns:
        (3, P) means, and lower and upper ends of the intervals.
    """
    shares = np.array([fractions_at(places, getattr(curve, axis), curve.explored) for curve in curves]).T
    return np.array([estimate(found) for found in shares.reshape(len(places), -1, seeds)]).T
