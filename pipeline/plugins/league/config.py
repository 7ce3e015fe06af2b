"""Parameters of the files that are handed in and of their validation."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ValidationConfig:
    """Tolerances with which the rules are checked; all are assumptions.

    Attributes:
        smallest, largest: limits of a point cloud's extent, m; in millimetres, even an arena of 1 m exceeds them.
        around: horizontal distance from the origin of a point cloud within which floor is expected, m.
        lowest_share: quantile of the heights of the points around the origin that is taken as the floor.
        floor: maximum error of the floor's height, m: a voxel.
        unit: maximum error of the length of a normal.
        rarest: minimum share of the pixels along the image's border that each grey of the checkerboard must have.
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
    """Parameters of the files for the leagues.

    Attributes:
        normal_neighbours: number of neighbours from which a point's normal is estimated.
        validation: tolerances of the validation.
    """

    normal_neighbours: int = 20
    validation: ValidationConfig = ValidationConfig()
