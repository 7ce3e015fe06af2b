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
        rest: area of smaller unseen patches, m².
        seen: area of the ground that was seen, m²; if the robot can reach any, only of ground connected to that.
        is_reachable: whether the robot can reach any ground; if not, it is unknown which ground is connected to it.
    """

    places: list[ReportedPlace]
    rest: float
    seen: float
    is_reachable: bool

    @property
    def area(self) -> float:
        """Area of the unseen ground, m²."""
        return self.rest + sum(place.area for place in self.places)

    @property
    def share(self) -> float | None:
        """Share of the ground that was seen; None if no ground is reachable."""
        whole = self.seen + self.area
        return self.seen / whole if self.is_reachable and whole else None


def find_unseen(
    traversability: Traversability, measured: Layer, reachable: MaskLayer, robot: RobotModel, config: UnseenConfig
) -> Unseen:
    """The ground that was not seen: inside the map's outline, and beyond the reachable ground.

    Args:
        traversability: traversability of the robot's map.
        measured: height of the ground as measured by returns, m; NaN elsewhere.
        reachable: cells that the robot can reach.
        robot: the robot; ground within its length of reachable ground counts as connected.
        config: where ground is expected.
    """
    grid, unknown = traversability.grid, np.isnan(measured)
    outline = ndimage.binary_fill_holes(~np.isnan(traversability.elevation))
    is_clear = traversability.to_hazard >= config.from_wall
    # A partly seen wall has gaps; ground is expected to extend only through wide ones.
    ahead = ndimage.binary_dilation(reachable, iterations=round(config.ahead / grid.cell), mask=is_clear)
    cells = unknown & (outline | ahead) & is_clear
    found = sorted(places(grid, cells, cells, 0), key=lambda place: -place.area)
    is_reachable = bool(reachable.any())
    joins = grid.distance_to(reachable) <= robot.length if is_reachable else np.True_
    return Unseen(
        places=[place for place in found if place.area >= config.person_area],
        rest=sum(place.area for place in found if place.area < config.person_area),
        seen=float(np.count_nonzero(joins & ~unknown & ~traversability.hazard)) * grid.cell**2,
        is_reachable=is_reachable,
    )
