"""The numbers of handed-in files and of their validation."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ValidationConfig:
    """How the rules' words are checked; all are assumptions.

    Attributes:
        smallest, largest: m, extent of a cloud; in millimetres an arena of 1 m has more.
        around: m around the origin of a cloud, in which there is floor.
        lowest_share: of the points around the origin that may lie below the floor, or be the floor.
        floor: m, error of the floor's height: a voxel.
        unit: error of the length of a normal.
        rarest: share of the picture's frame that each grey of the checkerboard has.
    """

    smallest: float = 1.0
    largest: float = 200.0
    around: float = 2.0
    lowest_share: float = 0.01
    floor: float = 0.1
    unit: float = 0.05
    rarest: float = 0.01


@dataclass(frozen=True)
class LeagueConfig:
    """Files for the leagues.

    Attributes:
        normal_neighbours: number of neighbours from which a point's normal is estimated.
        validation: what a judge would reject.
    """

    normal_neighbours: int = 20
    validation: ValidationConfig = ValidationConfig()
