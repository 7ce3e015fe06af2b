"""The ground that the robot has not seen, as far as this follows from its own map."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from pipeline.arrays import Layer, MaskLayer
from pipeline.elevation_map.traversability import Traversability
from pipeline.rescue_report.config import UnseenConfig
from pipeline.rescue_report.places import ReportedPlace, places
from pipeline.robot import RobotModel


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
        whole = self.seen + self.area
        return self.seen / whole if whole else 0.0


def find_unseen(
    traversability: Traversability, measured: Layer, reachable: MaskLayer, robot: RobotModel, config: UnseenConfig
) -> Unseen:
    """The ground that was not seen: inside the map's outline, and beyond the reachable ground.

    Args:
        traversability: of the robot's map.
        measured: height of the ground, m, measured by returns; NaN elsewhere.
        reachable: cells that the robot can reach.
        robot: ground with returns counts as seen within its length.
        config: where ground is expected.
    """
    grid, unknown = traversability.grid, np.isnan(measured)
    outline = ndimage.binary_fill_holes(~np.isnan(traversability.elevation))
    is_clear = traversability.to_hazard >= config.from_wall
    # A wall that was seen in part has gaps; ground extends only through wide gaps.
    ahead = ndimage.binary_dilation(reachable, iterations=round(config.ahead / grid.cell), mask=is_clear)
    cells = unknown & (outline | ahead) & is_clear
    found = sorted(places(grid, cells, cells, 0), key=lambda place: -place.area)
    near = grid.distance_to(reachable) <= robot.length
    return Unseen(
        places=[place for place in found if place.area >= config.person_area],
        rest=sum(place.area for place in found if place.area < config.person_area),
        seen=float(np.count_nonzero(near & ~unknown & ~traversability.hazard)) * grid.cell**2,
    )
