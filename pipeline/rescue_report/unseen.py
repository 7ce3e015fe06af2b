"""The ground that the robot has not seen, as far as this follows from its own map."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.elevation_map.traversability import Traversability
from pipeline.rescue_report.places import ReportedPlace, places
from pipeline.robot import RobotModel

FROM_WALL = 0.15
"""m from a wall or a step; nearer to it no ground is expected."""
EXPECTED_AHEAD = 1.0
"""m beyond the reachable ground within which more ground is expected if no wall or step is between."""
PERSON_AREA = 0.2
"""m², least area that a person takes."""


@dataclass(frozen=True, eq=False)
class Unseen:
    """Ground that was not seen.

    Attributes:
        places: places of unseen ground large enough for a person, the largest first.
        rest: m² of smaller unseen patches.
        seen: m² of ground that was seen.
    """

    places: list[ReportedPlace]
    rest: float
    seen: float

    @property
    def area(self) -> float:
        """Area of the unseen ground, m²."""
        return self.rest + sum(place.area for place in self.places)

    @property
    def share(self) -> float:
        """Seen share of the seen and unseen ground; 0 if there is none."""
        known = self.seen + self.area
        return self.seen / known if known else 0.0


def find_unseen(
    traversability: Traversability, measured: NDArray[np.float32], reachable: NDArray[np.bool_], robot: RobotModel
) -> Unseen:
    """The ground that was not seen: inside the map's outline, and beyond the reachable ground.

    Args:
        traversability: of the robot's map.
        measured: (nx, ny) height of the ground measured by returns, NaN elsewhere.
        reachable: (nx, ny) cells that the robot can reach.
        robot: ground with returns counts as seen within its length.
    """
    grid, unknown = traversability.grid, np.isnan(measured)
    outline = ndimage.binary_fill_holes(~np.isnan(traversability.elevation))
    is_clear = traversability.to_hazard >= FROM_WALL
    # A wall that was seen in part has gaps; ground extends only through wide gaps.
    ahead = ndimage.binary_dilation(reachable, iterations=round(EXPECTED_AHEAD / grid.cell), mask=is_clear)
    cells = unknown & (outline | ahead) & is_clear
    found = sorted(places(grid, cells, cells, 0), key=lambda place: -place.area)
    near = grid.distance_to(reachable) <= robot.length
    return Unseen(
        places=[place for place in found if place.area >= PERSON_AREA],
        rest=sum(place.area for place in found if place.area < PERSON_AREA),
        seen=float(np.count_nonzero(near & ~unknown & ~traversability.hazard)) * grid.cell**2,
    )
