"""Parameters of the inspection of walls, of the files that are submitted, and of their validation."""

from dataclasses import dataclass

from pipeline.errors import require_at_least, require_positive


@dataclass(frozen=True)
class ValidationConfig:
    """Tolerances with which the rules are checked; all are assumptions.

    Attributes:
        smallest, largest: minimum and maximum extent of a point cloud, m; with coordinates in millimetres, even an
            arena of 1 m exceeds the maximum.
        around: horizontal distance from the origin of a point cloud within which floor is expected, m.
        floor_quantile: quantile of the heights of the points around the origin that is taken as the floor.
        floor_tolerance: maximum error of the floor's height, m; the default is the size of a voxel.
        normal_tolerance: maximum error of the length of a normal.
        min_grey_fraction: minimum fraction of the pixels along the image's border for each grey of the checkerboard.
    """

    smallest: float = 1.0
    largest: float = 200.0
    around: float = 2.0
    floor_quantile: float = 0.01
    floor_tolerance: float = 0.1
    normal_tolerance: float = 0.05
    min_grey_fraction: float = 0.01


@dataclass(frozen=True)
class InspectionConfig:
    """When a keyframe has shown a wall well enough, and from where the other walls are inspected.

    Attributes:
        square: side of the squares of a depth image that are tested as pieces of wall, pixels.
        flatness: RMS distance of points from their plane above which a piece is rejected, in standard deviations of
            the depth.
        upright: maximum vertical component of a piece's normal.
        highest: maximum height of a piece above the ground, m, because signs and other finds hang no higher.
        sign: side of a typical sign, such as the hazmat signs that the leagues print, m.
        readable: minimum width of such a sign in the image for it to be readable, pixels.
        standoff: distance from a wall to the points in front of it that represent its pieces, m. Points on the two
            sides of a wall are then farther apart than ``spacing``.
        spacing: spacing of these points, m; a point within this distance of a point that was readable or aimed at
            needs no inspection.
        depth: length in front of a wall over which a line of sight is not checked, m.
        beside_camera: length at the camera over which a line of sight is not checked, m, because the robot will be
            there.
    """

    square: int = 8
    flatness: float = 2.0
    upright: float = 0.5
    highest: float = 2.0
    sign: float = 0.2
    readable: float = 60.0
    standoff: float = 0.3
    spacing: float = 0.3
    depth: float = 0.3
    beside_camera: float = 0.3

    def __post_init__(self) -> None:
        require_positive("plugins.league.inspection", self, "spacing", "sign")
        require_at_least(1, "plugins.league.inspection", self, "square")


@dataclass(frozen=True)
class LeagueConfig:
    """Parameters of a mission and of its files.

    Attributes:
        normal_neighbours: number of neighbours from which a point's normal is estimated.
        validation: tolerances of the validation.
        inspection: settings of the inspection of walls after exploration.
    """

    normal_neighbours: int = 20
    validation: ValidationConfig = ValidationConfig()
    inspection: InspectionConfig = InspectionConfig()
