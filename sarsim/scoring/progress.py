"""How soon ground was seen: times until most of it was, and areas under the explored share."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Values

MOST = {"t90_s": 0.9, "t99_s": 0.99}
"""Shares of the drivable area for which the time until they were seen is reported."""


class ExploredCurve(NamedTuple):
    """How much was seen when; a share holds until the next.

    Attributes:
        time_s: s since the start at which something was seen, rising.
        way_m: m that the robot had driven by then.
        explored: share of the area that was seen by then.
    """

    time_s: Values
    way_m: Values
    explored: Values


def progress_figures(curve: ExploredCurve, end: tuple[float, float]) -> dict[str, float]:
    """The figures of an exploration for report.json.

    Args:
        curve: of N places, with times in s and ways in m.
        end: s and m at the end.

    Returns:
        ``auc_time`` in s and ``auc_way`` in m, areas under the share up to the end, and the times in :data:`MOST`,
        those that were reached.
    """
    times, ways, shares = curve
    reached = {name: times[shares >= most] for name, most in MOST.items()}
    areas = {"auc_time": area_under(times, shares, end[0]), "auc_way": area_under(ways, shares, end[1])}
    return {name: float(found[0]) for name, found in reached.items() if len(found)} | areas


def area_under(along: NDArray[np.float64], shares: NDArray[np.float64], end: float) -> float:
    """Area under shares (N,), each of which holds from its place ``along`` (N,), s or m, to the next, or the end."""
    return float(shares @ np.diff(along, append=end))


def shares_at(places: NDArray[np.float64], along: NDArray[np.float64], shares: NDArray[np.float64]) -> Values:
    """Shares at places (P,), s or m, where shares (N,) hold from their ``along`` (N,) on; 0 before the first."""
    held: NDArray[np.float64] = np.append(0.0, shares)[np.searchsorted(along, places, side="right")]
    return held


def mean_up_to(
    horizon: NDArray[np.float64], end: NDArray[np.float64], figures: Mapping[str, NDArray[np.float64]], axis: str
) -> NDArray[np.float64]:
    """(A, S) mean explored shares up to a horizon that is not before the end; the last share holds from there.

    Args:
        horizon: (A, 1) s or m up to which the mean is taken.
        end: (A, S) s or m, of each exploration.
        figures: (A, S) each of :func:`progress_figures`, and ``explored_fraction``, the last share.
        axis: ``time`` or ``way``.
    """
    return (figures[f"auc_{axis}"] + figures["explored_fraction"] * (horizon - end)) / horizon
