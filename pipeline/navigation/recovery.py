"""Recovery: straight out of a place where the robot cannot turn; out of one that is shut, as it came."""

import numpy as np
from numpy.typing import NDArray

from pipeline.navigation.navigator import Halt
from pipeline.robot import RobotModel
from pipeline.transforms import transform_points
from pipeline.traversability.shortest_paths import ShortestPaths
from pipeline.traversability.traversability import Traversability

LONGEST = 0.8
"""m that are tried."""
SPACING = 0.05
"""m between the places that are tried."""
NEAR = 0.1
"""m around the robot that need not be traversable: it may have slid nearer to something than it may stand."""
STRIDE = 0.4
"""m between the places of a way back."""
BUMPER_GAP = 0.036
"""m before the footprint, where the robot puts what it touched."""


def escape(
    traversability: Traversability, T_map_base: NDArray[np.float64], was_held: bool = False
) -> NDArray[np.float64]:
    """(2,) m, the nearest place before or behind the robot where it can turn; its own if it need not go there.

    Where no straight way leads to such a place, its own as well; but for a robot that ``was_held`` and has got
    nowhere since, the place before or behind it with most room, if that is more than it has.
    """
    here, ahead = T_map_base[:2, 3], T_map_base[:2, 0] / np.linalg.norm(T_map_base[:2, 0])
    if traversability.grid.at(traversability.to_hazard, here) >= traversability.robot.corner_radius:
        return here
    way = np.arange(SPACING, LONGEST, SPACING)
    signed = np.stack([way, -way], axis=1).ravel()[:, None]
    places, starts = here + signed * ahead, here + np.clip(signed, -NEAR, NEAR) * ahead
    good = traversability.grid.at(traversability.can_turn, places)
    good &= traversability.lines_are_traversable(starts, places)
    if good.any():
        return places[good.argmax()]
    return _roomiest(traversability, here, places) if was_held else here


def _roomiest(
    traversability: Traversability, here: NDArray[np.float64], places: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(2,) m, of places (2 N, 2) by turns before and behind, the one with most room that the robot gets to."""
    grid, near = traversability.grid, np.linalg.norm(places - here, axis=1) <= NEAR
    passable = grid.at(traversability.traversable, places) | near
    passable = np.logical_and.accumulate(passable.reshape(-1, 2)).ravel()
    room = np.where(passable, grid.at(traversability.to_hazard, places), 0.0)
    best = room.argmax()
    return places[best] if room[best] > grid.at(traversability.to_hazard, here) + SPACING else here


def backtrack(paths: ShortestPaths, track: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """The way back to where the robot came from, if the map says that it could not have come from there.

    It slid out of there, or noise of later frames shut the passage.

    Args:
        paths: that lead from where it is.
        track: (N, 2) m where it has been, place by place.

    Returns:
        (M, 2) m, back along the track to the last place where it can turn and to which no path leads; None if
        there is none.
    """
    grid = paths.traversability.grid
    can_turn = grid.at(paths.traversability.can_turn, track)
    beyond = np.flatnonzero(can_turn & ~np.isfinite(grid.at(paths.cost, track)))
    if not len(beyond):
        return None
    way = track[beyond[-1] :][::-1]
    driven = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1)))
    return way[np.append(np.diff(driven // STRIDE) > 0, True)]


def touched(halt: Halt, robot: RobotModel) -> NDArray[np.float64]:
    """(N, 3) points in ``map`` right before the end of the robot that was held, as high as its body, m."""
    ahead = (robot.half_length + BUMPER_GAP) * np.sign(halt.command.v)
    across = np.linspace(-robot.half_width, robot.half_width, 21)
    points = [[ahead, left, robot.body_height] for left in across]
    return transform_points(halt.T_map_base, np.array(points)).astype(np.float64)
