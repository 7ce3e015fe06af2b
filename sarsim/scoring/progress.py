"""Figures of exploration progress: times until most of the ground was seen, and areas under the explored fraction."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Values

EXPLORED_FRACTIONS = {"t90_s": 0.9, "t99_s": 0.99}
"""Fractions of the drivable area, by the name of the figure that gives the time until the fraction was seen."""


class ExploredCurve(NamedTuple):
    """The explored fraction over time; each value holds until the next.

    Attributes:
        time_s: (N,) increasing times since the start, s, at which the fraction was measured.
        way_m: (N,) distance that the robot had driven by each time, m.
        explored: (N,) fraction of the drivable area that had been seen by each time.
    """

    time_s: Values
    way_m: Values
    explored: Values


def progress_figures(curve: ExploredCurve, end: tuple[float, float]) -> dict[str, float]:
    """The figures of an exploration for report.json.

    Args:
        curve: the explored fraction at N points, with times in s and distances in m.
        end: time, s, and distance, m, at the end.

    Returns:
        ``auc_time`` in s and ``auc_way`` in m, the areas under the curve up to the end, and those times in
        :data:`EXPLORED_FRACTIONS` whose fractions were reached.
    """
    times, ways, shares = curve
    reached = {name: times[shares >= most] for name, most in EXPLORED_FRACTIONS.items()}
    areas = {"auc_time": area_under(times, shares, end[0]), "auc_way": area_under(ways, shares, end[1])}
    return {name: float(found[0]) for name, found in reached.items() if len(found)} | areas


def area_under(along: NDArray[np.float64], fractions: NDArray[np.float64], end: float) -> float:
    """Area under fractions (N,), each of which holds from its ``along`` (N,), s or m, to the next one or the end."""
    return float(fractions @ np.diff(along, append=end))


def fractions_at(places: NDArray[np.float64], along: NDArray[np.float64], fractions: NDArray[np.float64]) -> Values:
    """(P,) the fractions that hold at ``places`` (P,), s or m.

    Each of ``fractions`` (N,) holds from its value of ``along`` (N,), s or m, to the next value. Before the first
    value, the fraction is 0.
    """
    held: NDArray[np.float64] = np.append(0.0, fractions)[np.searchsorted(along, places, side="right")]
    return held


def mean_up_to(
    horizon: NDArray[np.float64], end: NDArray[np.float64], figures: Mapping[str, NDArray[np.float64]], axis: str
) -> NDArray[np.float64]:
    """(A, S) mean explored fractions up to a horizon no earlier than the end; after the end, the last fraction holds.

    Args:
        horizon: (A, 1) s or m up to which the mean is taken.
        end: (A, S) s or m, end of each exploration.
        figures: (A, S) each figure of :func:`progress_figures`, and ``explored_fraction``, the last fraction.
        axis: ``time`` or ``way``.
    """
    return (figures[f"auc_{axis}"] + figures["explored_fraction"] * (horizon - end)) / horizon
