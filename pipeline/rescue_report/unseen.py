"""Which ground the robot has not seen, as far as its own map can tell."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.rescue_report.places import Place, places
from pipeline.traversability.traversability import Traversability

FROM_WALL = 0.15
"""m from a wall or a step; nearer to them no ground is expected."""
AHEAD = 1.0
"""m beyond where the robot can go within which ground is expected if no wall or step is between."""
ROOM = 0.2
"""m² that a person takes, at least."""
SIDE = 0.4
"""m beside where the robot's middle can be; ground within counts as seen if a return has shown it."""


@dataclass(frozen=True, eq=False)
class Unseen:
    """Ground that was not seen.

    Attributes:
        places: of such ground, large enough for a person, the largest first.
        rest: m² of smaller patches.
        seen: m² of ground that was seen.
    """

    places: list[Place]
    rest: float
    seen: float

    @property
    def area(self) -> float:
        """Of the ground that the map tells of, the part that was not seen, m²."""
        return self.rest + sum(place.area for place in self.places)

    @property
    def share(self) -> float:
        """Of the ground that the map tells of, the share that was seen."""
        known = self.seen + self.area
        return self.seen / known if known else 0.0


def find_unseen(
    traversability: Traversability, measured: NDArray[np.float32], reachable: NDArray[np.bool_]
) -> Unseen:
    """The ground that was not seen: inside the map's outline, and ahead of where the robot can go.

    Args:
        traversability: of the robot's map.
        measured: (nx, ny) height of the ground that returns have shown, NaN elsewhere.
        reachable: (nx, ny) where the robot can go.
    """
    grid, unknown = traversability.grid, np.isnan(measured)
    outline = ndimage.binary_fill_holes(~np.isnan(traversability.elevation))
    is_clear = traversability.to_hazard >= FROM_WALL
    # A wall that was seen in part has gaps; ground extends through wide ones alone.
    ahead = ndimage.binary_dilation(reachable, iterations=round(AHEAD / grid.cell), mask=is_clear)
    cells = unknown & (outline | ahead) & is_clear
    found = sorted(places(grid, cells, cells, 0), key=lambda place: -place.area)
    near = grid.distance_to(reachable) <= SIDE
    return Unseen(
        places=[place for place in found if place.area >= ROOM],
        rest=sum(place.area for place in found if place.area < ROOM),
        seen=float(np.count_nonzero(near & ~unknown & ~traversability.hazard)) * grid.cell**2,
    )
