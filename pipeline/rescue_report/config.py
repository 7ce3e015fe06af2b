"""The numbers of the rescue report."""

from dataclasses import dataclass
from math import radians


@dataclass(frozen=True)
class HazardConfig:
    """What is dangerous for those who go in.

    Attributes:
        steep: rad; steeper ground is a slope.
        drop: m, least height of a drop: a robot that takes stairs climbs lower steps back up. The edge of a drop
            differs by less in height from the ground in front of it; a kerb differs by more.
        edge: cells along each side of a window: an edge is at most as wide as half of it.
        upright: m of headroom below which a person must stoop.
    """

    steep: float = radians(8)
    drop: float = 0.1
    edge: int = 5
    upright: float = 2.0


@dataclass(frozen=True)
class UnseenConfig:
    """Where ground is expected that was not seen.

    Attributes:
        from_wall: m from a wall or a step; nearer to it no ground is expected.
        ahead: m beyond the reachable ground within which more ground is expected if no wall or step is between.
        person_area: m², least area that a person takes.
    """

    from_wall: float = 0.15
    ahead: float = 1.0
    person_area: float = 0.2


@dataclass(frozen=True)
class RouteConfig:
    """Ways to people.

    Attributes:
        arrival: m, greatest distance from the robot's middle to a person's points at which the robot is beside the
            person.
        views: most cells whose line of sight to a person is checked: the nearest, and ever fewer of those farther
            off.
        bend: rad; at a bend of more than this, a new straight part begins.
        steep: rad; directions mention the slope of a part over steeper ground.
    """

    arrival: float = 1.0
    views: int = 400
    bend: float = radians(20)
    steep: float = radians(8)


@dataclass(frozen=True)
class PostureConfig:
    """How a person's size determines the posture.

    Attributes:
        lying_length: m; a person at least this long may be lying.
        lying_ratio: least length of a lying person, as a multiple of the height.
        sitting_height: m; a person at least this high may be sitting, kneeling or leaning.
        sitting_ratio: least height of a sitting person, as a share of the length.
        outliers: share of the points that are left out at either end of a side.
    """

    lying_length: float = 1.0
    lying_ratio: float = 2.0
    sitting_height: float = 0.6
    sitting_ratio: float = 2 / 3
    outliers: float = 0.01


@dataclass(frozen=True)
class TrustConfig:
    """When the map is to be trusted.

    Attributes:
        checked: most keyframes that are compared with the map, evenly spread over the run.
        agreement: least share of the keyframes' depth that agrees with the map. What contradicts it is 0.002 with
            poses right to 2 cm, 0.018 with a heading that drifts by 8° in 28 m, 0.10 with 16°.
        deviation: m, standard deviation above which a place may be mistaken for the next one: a robot's way is 0.6 m
            wide.
    """

    checked: int = 100
    agreement: float = 0.99
    deviation: float = 0.3


@dataclass(frozen=True)
class DrawingConfig:
    """The drawing of the map.

    Attributes:
        most_named: places of one kind that are numbered on the drawing and listed on the page, the worst first.
        lines: least number of lines of round coordinates along the longer side.
        extent: units, width and height into which the drawing fits, unless the arena is so large that a metre would
            be narrower than a symbol.
        symbol: units, the width of symbols.
        arrows: units between arrows up a slope.
        border: m around the mapped cells.
        bar: greatest length of the scale, as a share of the width.
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
    """The numbers of the report's parts."""

    hazards: HazardConfig = HazardConfig()
    unseen: UnseenConfig = UnseenConfig()
    routes: RouteConfig = RouteConfig()
    posture: PostureConfig = PostureConfig()
    trust: TrustConfig = TrustConfig()
    drawing: DrawingConfig = DrawingConfig()
