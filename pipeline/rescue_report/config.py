"""Parameters of the rescue report."""

from dataclasses import dataclass
from math import radians


@dataclass(frozen=True)
class HazardConfig:
    """What is dangerous for those who go in.

    Attributes:
        drop: minimum height of a drop, m: a robot that climbs stairs gets back up lower steps. The edge of a drop
            differs in height by less than this from the ground in front of it, a kerb by more.
        edge: side of the window in which the ground in front of an edge is sought, cells; an edge is at most half as
            wide.
        upright: headroom below which a person must stoop, m.
    """

    drop: float = 0.1
    edge: int = 5
    upright: float = 2.0


@dataclass(frozen=True)
class UnseenConfig:
    """Where unseen ground is expected.

    Attributes:
        from_wall: distance from walls and steps below which no ground is expected, m.
        ahead: distance beyond the reachable ground within which more is expected unless a wall or step is between, m.
        person_area: minimum area that a person takes up, m².
    """

    from_wall: float = 0.15
    ahead: float = 1.0
    person_area: float = 0.2


@dataclass(frozen=True)
class RouteConfig:
    """Paths to people.

    Attributes:
        arrival: maximum distance from the robot's centre to a person's points at which the robot is next to the
            person, m.
        views: maximum number of cells whose line of sight to a person is checked: the nearest, and fewer of those
            farther away.
        bend: change of direction above which a new straight part begins, rad.
    """

    arrival: float = 1.0
    views: int = 400
    bend: float = radians(20)


@dataclass(frozen=True)
class PostureConfig:
    """How a person's size determines the posture.

    Attributes:
        lying_length: minimum length of a lying person, m.
        lying_ratio: minimum length of a lying person, as a multiple of the height.
        sitting_height: minimum height of a person who is sitting, kneeling or leaning, m.
        sitting_ratio: minimum height of such a person, as a share of the length.
        outliers: share of the points that is left out at either end of each dimension.
    """

    lying_length: float = 1.0
    lying_ratio: float = 2.0
    sitting_height: float = 0.6
    sitting_ratio: float = 2 / 3
    outliers: float = 0.01


@dataclass(frozen=True)
class TrustConfig:
    """When the map can be trusted.

    Attributes:
        checked: maximum number of keyframes that are compared with the map, evenly spread over the run.
        agreement: minimum share of the keyframes' depth that agrees with the map. The share that contradicts it is
            0.002 if poses are correct to 2 cm, 0.018 if the heading drifts by 8° in 28 m, and 0.10 if by 16°.
        deviation: standard deviation above which a position may be mistaken for an adjacent one, m: a robot's path is
            0.6 m wide.
    """

    checked: int = 100
    agreement: float = 0.99
    deviation: float = 0.3


@dataclass(frozen=True)
class DrawingConfig:
    """The drawing of the map.

    Attributes:
        most_named: maximum number of places of one kind that are numbered on the drawing and listed on the page, the
            worst first.
        lines: minimum number of lines at round coordinates along the longer side.
        extent: width and height into which the drawing fits, units, unless the arena is so large that a metre would
            be narrower than a symbol.
        symbol: width of symbols, units.
        arrows: distance between arrows up a slope, units.
        border: margin around the mapped cells, m.
        bar: maximum length of the scale bar, as a share of the width.
    """

    most_named: int = 10
    lines: int = 6
    extent: float = 1000.0
    symbol: float = 30.0
    arrows: float = 45.0
    border: float = 0.4
    bar: float = 0.25


@dataclass(frozen=True)
class RescueReportConfig:
    """Parameters of the report's parts."""

    hazards: HazardConfig = HazardConfig()
    unseen: UnseenConfig = UnseenConfig()
    routes: RouteConfig = RouteConfig()
    posture: PostureConfig = PostureConfig()
    trust: TrustConfig = TrustConfig()
    drawing: DrawingConfig = DrawingConfig()
