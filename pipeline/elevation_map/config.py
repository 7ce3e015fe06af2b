"""Settings of the elevation map, of traversability and of the cost of driving."""

from dataclasses import dataclass
from math import radians


@dataclass(frozen=True)
class DropoutConfig:
    """Which gaps in the depth image may hide a thin panel.

    Attributes:
        fewest: least extent of a gap in pixels and in rows; smaller ones are noise.
        widest: pixels, the greatest width of a gap; wider ones leave unknown ground behind them.
        row_step: spacing of the rows that are searched, rows.
    """

    fewest: int = 3
    widest: int = 60
    row_step: int = 2


@dataclass(frozen=True)
class OverhangConfig:
    """Which surfaces hide the space above the ground, where something may hang too low for the robot.

    Attributes:
        nearer: m by which a surface must be nearer than the space that it hides: the surface itself is in the map.
        deviations: further margin, in standard deviations of the sensor's noise.
        reach: m, greatest extent of an overhang behind its edge.
        fewest: least number of pixels, one above the other, that show it; fewer are noise at an edge.
        beside: m to either side over which it must continue, with ground below; this rules out upright edges, which
            also hide what is behind them.
    """

    nearer: float = 0.05
    deviations: float = 3.0
    reach: float = 2.0
    fewest: int = 2
    beside: float = 0.05


@dataclass(frozen=True)
class PathCosts:
    """What driving costs, in seconds, apart from what follows from the robot's own data.

    Attributes:
        comfort: m of room around the footprint that lets the robot drive at full speed. More room makes no
            difference, so clearances are computed up to this distance.
        narrow_stop: m, stopping distance that the robot keeps where obstacles leave no room around its footprint; a
            Pioneer then drives at 0.2 m/s.
        ramp_pace: share of its speed and turn rate that the robot reaches on ramps, where it slips and realigns
            itself.
        turn_pace: share of its greatest turn rate that the robot reaches on average, acceleration and braking
            included.
        stray: m, greatest deviation of the robot from its path.
        backing: cost of driving backwards relative to forwards: the camera then looks away from the direction of
            travel.
        risk: s added per second of driving in which the robot is certain to hit an obstacle.
        stop: s that a bend in the path costs, for braking and accelerating again.
        tick: s, resolution of costs in the search.
    """

    comfort: float = 0.2
    narrow_stop: float = 0.067
    ramp_pace: float = 0.65
    turn_pace: float = 0.42
    stray: float = 0.1
    backing: float = 2.0
    risk: float = 20.0
    stop: float = 1.5
    tick: float = 0.01


@dataclass(frozen=True)
class TraversabilityConfig:
    """Where the robot may stand, turn and drive.

    Attributes:
        slope_reach: cells to each side over which the slope of a cell is fitted.
        surface_slope, surface_rise: m per m, and m. A neighbour whose height differs by more than both together
            belongs to another surface (a wall, the floor under a deck) and is left out of the fit.
        drop_gap: m, greatest width of unknown ground between the two sides of a drop.
        ramp_tilt: rad; steeper ground is a ramp.
        ramp_margin: m; this close to a ramp the robot drives as on the ramp, because its wheels may already be on it.
        leniency: m by which the robot may come nearer to unknown ground than to a hazard.
        turn_leniency: m by which a turn to the next heading may come nearer to an obstacle than a pose.
        least_driven: m, least clearance assumed where the middle of the robot has been, so that noise in later
            keyframes does not trap it.
        deepest_driven: share of half the robot's width. An obstacle this far inside the footprint counts even where
            the robot has been: drift of the map cannot explain it.
        tall: m; a hazard that is higher than this above the ground around it hides what is behind it.
        wall_gap: cells along each side of a window; for rays, an unseen cell is as high as the highest hazard in its
            window.
        costs: of drives over this ground.
    """

    slope_reach: int = 2
    surface_slope: float = 1.2
    surface_rise: float = 0.02
    drop_gap: float = 0.6
    ramp_tilt: float = radians(8)
    ramp_margin: float = 0.2
    leniency: float = 0.03
    turn_leniency: float = 0.01
    least_driven: float = -0.03
    deepest_driven: float = 0.5
    tall: float = 0.4
    wall_gap: int = 5
    costs: PathCosts = PathCosts()


@dataclass(frozen=True)
class ElevationConfig:
    """How high the ground is.

    Attributes:
        cell: m, side of a cell.
        lowest: m above the start of the robot (usually negative), the lowest height that is mapped.
        bin: m, height of the bins of a column. The returns in a bin are averaged; one bin is centred on z = 0.
        levels: number of bins of a column.
        fewest: least number of returns in a bin, or dropouts in a cell; fewer are noise.
        noise: share of a bin's returns that may stray into the next one.
        ray_height: m; a ray that passes a cell at most this high above the ground shows that no wall stands there.
        start_radius: m from the start within which the robot assumes level ground until it sees the ground.
        start_ahead: m, length of the strip in front of the robot that it assumes to be level at the start.
        dropouts: gaps in the depth image.
        overhangs: above the ground.
        traversability: where the robot may drive.
    """

    cell: float = 0.05
    lowest: float = -0.575
    bin: float = 0.05
    levels: int = 53
    fewest: int = 3
    noise: float = 0.1
    ray_height: float = 0.3
    start_radius: float = 0.2
    start_ahead: float = 1.4
    dropouts: DropoutConfig = DropoutConfig()
    overhangs: OverhangConfig = OverhangConfig()
    traversability: TraversabilityConfig = TraversabilityConfig()

    @property
    def highest(self) -> float:
        """M above the start of the robot up to which ground is mapped."""
        return self.lowest + self.levels * self.bin
