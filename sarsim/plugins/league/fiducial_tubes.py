"""Tubes that serve as fiducials: their positions in the map, and a check of the codes' distances from the tubes.

The small league of RoboCup Rescue checks whether the map, seen from above, shows a tube cut in two by a wall as half
circles. It also checks whether a code's straight-line distances to the two nearest tubes are right.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Place, Places, Values
from sarsim.arenas.things.thing import things_of, things_of_kind
from sarsim.plugins.lanes.maze import TUBE_PREFIX

SECTOR_ANGLE = 10  # Degrees; width of the sectors into which a circle is divided


@dataclass(frozen=True)
class TubeConfig:
    """Parameters of the search for a tube in a map; all values are assumptions.

    Attributes:
        max_displacement: maximum displacement of a tube in the map along x and along y, m.
        max_radial_error: maximum distance from a circle at which a point is considered to be on the circle, m.
        step: spacing of the centres that are tried, m.
        floor_height: height above a tube's foot, m, up to which points belong to the floor.
        min_arc: minimum fraction of a circle with points on it; a half circle is 0.5, and a flat panel covers 0.27.
        tubes_per_code: number of nearest tubes from which a code's distances are checked, by the rule book of 2026.
    """

    max_displacement: float = 0.3
    max_radial_error: float = 0.03
    step: float = 0.02
    floor_height: float = 0.2
    min_arc: float = 0.4
    tubes_per_code: int = 2


@dataclass(frozen=True, eq=False)
class Tubes:
    """The tubes of an arena, and its QR codes.

    Attributes:
        feet: (N, 3) m in ``world``, the centre of each tube's foot.
        heights, radii: (N,) m, heights and radii of the tubes.
        codes: text and position, (3,) m in ``world``, of each code.
    """

    feet: Places
    heights: Values
    radii: Values
    codes: list[tuple[str, Place]]


def tubes_of(model: mujoco.MjModel, data: mujoco.MjData) -> Tubes:
    """The tubes and codes of an arena, whether or not a robot is in it."""
    geoms = [g for g in range(model.ngeom) if model.geom(g).name.rpartition("/")[2].startswith(TUBE_PREFIX)]
    half = model.geom_size[geoms, 1].reshape(-1)
    feet = data.geom_xpos[geoms].reshape(-1, 3) - half[:, None] * [0.0, 0.0, 1.0]
    codes = [(thing.text, thing.centre) for thing in things_of_kind(things_of(model, data), "qr_code")]
    return Tubes(feet, 2 * half, model.geom_size[geoms, 0].reshape(-1), codes)


def mapped_tubes(points: NDArray[np.floating], tubes: Tubes, config: TubeConfig = TubeConfig()) -> Places:
    """(N, 2) m in ``world``: position of each tube in a map of points (M, 3); NaN if the map does not show it."""
    flat = np.asarray(points, np.float64)
    found = [
        _fit_circle(_points_near(flat, foot, height, radius, config), foot[:2], radius, config)
        for foot, height, radius in zip(tubes.feet, tubes.heights, tubes.radii, strict=True)
    ]
    return np.array(found).reshape(-1, 2)


def _points_near(
    points: NDArray[np.float64], foot: Place, height: float, radius: float, config: TubeConfig
) -> NDArray[np.float64]:
    """(N, 2) m in ``world``, x and y of the points of a map (M, 3) that may belong to a tube."""
    reach = config.max_displacement + radius + config.max_radial_error
    up = points[:, 2] - foot[2]
    near = np.linalg.norm(points[:, :2] - foot[:2], axis=1) <= reach
    return points[near & (up > config.floor_height) & (up < height), :2]


def _fit_circle(points: NDArray[np.float64], near: Place, radius: float, config: TubeConfig) -> NDArray[np.float64]:
    """(2,) m, centre of the circle of ``radius``, m, with points in the most sectors; NaN if they are too few."""
    steps = np.arange(-config.max_displacement, config.max_displacement + config.step / 2, config.step)
    tried = near + np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    arcs = np.array([_arc(points, middle, radius, config.max_radial_error) for middle in tried])
    best = int(arcs.argmax())
    if arcs[best] < config.min_arc:
        return np.full(2, np.nan)
    return tried[arcs >= arcs[best]].mean(axis=0)


def _arc(points: NDArray[np.float64], middle: NDArray[np.float64], radius: float, max_radial_error: float) -> float:
    """Fraction of the sectors around ``middle`` (2,) m that have points (N, 2) m on the circle and none inside it."""
    away = points - middle
    distance = np.linalg.norm(away, axis=1)
    sector = np.floor(np.degrees(np.arctan2(away[:, 1], away[:, 0])) / SECTOR_ANGLE)
    on = np.unique(sector[np.abs(distance - radius) <= max_radial_error])
    inside = np.unique(sector[distance < radius - max_radial_error])
    return len(np.setdiff1d(on, inside)) * SECTOR_ANGLE / 360


def is_well_placed(
    place: Place, true: Place, shown: Places, tubes: Tubes, within: float, config: TubeConfig = TubeConfig()
) -> bool:
    """Whether the map gives a code's distances from the nearest tubes with errors of at most ``within`` m.

    Args:
        place, true: position of the code in the map and in the arena, m.
        shown: (N, 2) m, positions of the tubes in the map, as returned by :func:`mapped_tubes`.
        tubes: the tubes of the arena.
        within: tolerance, m.
        config: sets how many tubes are checked.
    """
    right = np.linalg.norm(tubes.feet[:, :2] - true[:2], axis=1)
    measured = np.linalg.norm(shown - place[:2], axis=1)
    nearest = np.argsort(right)[: config.tubes_per_code]
    return len(nearest) == config.tubes_per_code and bool((np.abs(measured - right)[nearest] <= within).all())


def nearest_code(text: str, place: Place, codes: Sequence[tuple[str, Place]]) -> Place | None:
    """Position, m, of the code with a given text that is nearest to ``place``; None if no code has this text."""
    of_text = [true for said, true in codes if said == text]
    return min(of_text, key=lambda true: float(np.linalg.norm(true - place)), default=None)
