"""Scores of a replay against the true poses."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Indices, Poses, Values
from pipeline.localisation.pose_graph import ConstraintKind
from scripts.benchmarks.localisation_scores import distances_driven, each_nees, errors_of, relative_poses, rms
from scripts.benchmarks.loops.replay import TourLocalisation
from scripts.benchmarks.loops.revisits import MIN_REVISIT_PATH
from scripts.benchmarks.loops.tours import Tour

FALSE_ERROR = 0.2, np.deg2rad(5)
"""m and rad; a constraint with a larger error in a direction that it determines is false."""
RIGHT_ERROR = 0.1, np.deg2rad(2)
"""m and rad; a constraint with a smaller error links two passes."""
MAX_CLOSURES = 12  # Maximum number of closures of a tour that are counted
PATH_RANGES = {"50": (0.0, 50.0), "200": (50.0, 200.0), "1000": (200.0, 1000.0), "more": (1000.0, np.inf)}
"""Ranges of the path's length, m, by the name of the NEES."""
KEYFRAME_GAPS = 10, 50, 200
"""Numbers of keyframes between the two keyframes whose relative poses are compared."""
PAIRS_PER_GAP = 60  # Approximate number of relative poses compared for each of these numbers


def scores(tour: Tour, run: TourLocalisation, stretches: list[Indices]) -> dict[str, Any]:
    """The figures of a tour; ``stretches`` are the results of :func:`revisits`."""
    way, true = distances_driven(tour.true), tour.true[run.keyframes]
    graph, path = run.slam.graph, float(way[-1])
    ate = rms(np.linalg.norm(run.poses()[:, :3, 3] - tour.true[:, :3, 3], axis=1))
    constraints, kinds = graph.constraints, graph.kinds
    off, angle = offsets(true, constraints.first, constraints.second, constraints.T, constraints.whitening)
    registered = (kinds == ConstraintKind.SURFACE) | (kinds == ConstraintKind.LOOP)
    is_false = registered & ((off > FALSE_ERROR[0]) | (angle > FALSE_ERROR[1]))
    is_right = registered & (off < RIGHT_ERROR[0]) & (angle < RIGHT_ERROR[1])
    frames = np.array(run.keyframes)
    ends = frames[constraints.first], frames[constraints.second]
    linked = closures = false_closures = 0
    for stretch in stretches:
        inside = (ends[1] >= stretch[0]) & (ends[1] <= stretch[-1]) & (way[ends[0]] < way[ends[1]] - MIN_REVISIT_PATH)
        linked += bool((inside & is_right).any())
        loops = inside & (kinds == ConstraintKind.LOOP)
        closures += bool(loops.any())
        false_closures += bool((loops & is_false).any())
    elsewhere = (kinds == ConstraintKind.LOOP) & is_false
    for stretch in stretches:
        elsewhere &= ~((ends[1] >= stretch[0]) & (ends[1] <= stretch[-1]))
    false_closures += bool(elsewhere.any())
    return {
        "revisits": len(stretches),
        "linked": linked,
        "constraints": int(registered.sum()),
        "false": int(is_false.sum()),
        "closures": min(closures, MAX_CLOSURES),
        "false_closures": false_closures,
        "ate_m": ate,
        "ate_percent": 100 * ate / path,
        "path_m": path,
        "keyframes": len(frames),
        "frame_ms": 1e3 * float(np.median([s for _, s in run.frame_s])),
        "settle_ms": 1e3 * float(np.median([s for _, s in run.settle_s])),
        "nees": _nees_by_length(tour, run, way),
        "relative_nees": _relative_nees(true, run),
    }


def offsets(
    true: Poses, first: Indices, second: Indices, T: Poses, whitening: NDArray[np.float64]
) -> tuple[Values, Values]:
    """(N,) m and (N,) rad, errors of constraints in the directions that they determine.

    Each direction is weighted by the constraint's information, divided by the sum of this information and the
    information of an error of ``FALSE_ERROR``.
    """
    errors = errors_of(relative_poses(true, first, second), T)
    information = whitening.swapaxes(1, 2) @ whitening
    least = np.diag(np.repeat([FALSE_ERROR[1], FALSE_ERROR[0]], 3) ** -2.0)
    kept = np.einsum("nij,nj->ni", np.linalg.solve(information + least, information), errors)
    return np.linalg.norm(kept[:, 3:], axis=1), np.linalg.norm(kept[:, :3], axis=1)


def _nees_by_length(tour: Tour, run: TourLocalisation, distances: Values) -> dict[str, list[float]]:
    """The NEES, per dimension, of the newest pose at each correction, by the name of the path's length."""
    frames, poses, covariances = map(np.array, zip(*run.corrections, strict=True))
    values = each_nees(errors_of(tour.true[frames], poses), covariances)
    return {
        name: values[(distances[frames] >= low) & (distances[frames] < high)].tolist()
        for name, (low, high) in PATH_RANGES.items()
    }


def _relative_nees(true: Poses, run: TourLocalisation) -> dict[str, list[float]]:
    """The NEES, per dimension, of final relative poses of keyframes, by the number of keyframes between them."""
    graph, found = run.slam.graph, dict[str, list[float]]()
    for apart in KEYFRAME_GAPS:
        first = np.arange(0, max(0, len(true) - apart), max(1, (len(true) - apart) // PAIRS_PER_GAP))
        if len(first):
            second = first + apart
            errors = errors_of(relative_poses(true, first, second), relative_poses(graph.poses, first, second))
            stated = np.array([graph.covariance(int(k) + apart, int(k)) for k in first])
            found[str(apart)] = each_nees(errors, stated).tolist()
    return found
