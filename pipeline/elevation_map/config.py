"""Settings of the elevation map, of traversability and of the cost of driving."""

from dataclasses import dataclass


@dataclass(frozen=True)
class DropoutConfig:
    """Which gaps in the depth image may hide a thin panel.

    Attributes:
        fewest: minimum extent of a gap, in pixels along a row and in searched rows; smaller ones are noise.
        widest: maximum width of a gap, pixels; wider ones leave unknown ground behind them.
        row_step: spacing of the rows that are searched, rows.
    """

    fewest: int = 3
    widest: int = 60
    row_step: int = 2


@dataclass(frozen=True)
class OverhangConfig:
    """Which surfaces hide the space above the ground, where something may hang too low for the robot.

    Attributes:
        nearer: minimum difference in depth between a surface and the space that it hides, m: the surface itself is in
            the map.
        deviations: additional margin, in standard deviations of the sensor's noise.
        reach: maximum extent of an overhang behind its edge, m.
        fewest: minimum number of pixels, one above the other, that show it; fewer are noise at an edge.
        beside: distance to both sides over which it must continue, with ground below, m; this rules out upright
            edges, which also hide what is behind them.
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
        comfort: free space around the footprint that lets the robot drive at full speed, m. More makes no difference,
            so clearances are computed up to this distance.
        narrow_stop: stopping distance that limits the speed where obstacles leave no room around the footprint, m; a
            Pioneer then drives at 0.2 m/s.
        ramp_pace: share of its ramp speed and turn rate that the robot reaches, because it slips and realigns itself.
        turn_pace: share of its maximum turn rate that the robot reaches on average, including acceleration and
            braking.
        stray: maximum deviation of the robot from its path, m.
        backing: cost of driving backwards relative to forwards: the camera then looks away from the direction of
            travel.
        risk: cost added per second of driving in which the robot is certain to hit an obstacle, s.
        stop: cost of a bend in the path, for braking and accelerating again, s.
        tick: resolution of costs in the search, s.
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
        slope_reach: radius of the neighbourhood over which the slope of a cell is fitted, cells.
        surface_slope, surface_rise: m per m, and m. A neighbour whose height differs by more than both together
            belongs to another surface (a wall, the floor under a deck) and is left out of the fit.
        drop_gap: maximum width of unknown ground between the two sides of a drop, m.
        ramp_margin: distance to a ramp within which the robot drives as on the ramp, because its wheels may already
            be on it, m.
        leniency: distance by which the robot may come closer to unknown ground than to a hazard, m.
        turn_leniency: distance by which a turn to the next heading may come closer to an obstacle than a pose may, m.
        least_driven: minimum clearance where the robot's centre has been, m; it is also assumed to exist there, so
            that noise in later keyframes does not trap the robot.
        deepest_driven: share of half the robot's width. An obstacle farther inside the footprint counts even where
            the robot has been: drift of the map cannot explain it.
        tall: a hazard higher than this above the ground around it hides what is behind it, m.
        wall_gap: side of a window, cells; for rays, an unknown cell is as high as the highest hazard in its window.
        costs: costs of driving.
    """

    slope_reach: int = 2
    surface_slope: float = 1.2
    surface_rise: float = 0.02
    drop_gap: float = 0.6
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
    """How the height of the ground is determined.

    Attributes:
        cell: side of a cell, m.
        lowest: lowest height that is mapped, m above the robot when it first sees a cell (usually negative). It is
            relative to the robot because estimated heights drift over long drives, and slopes lead far up or down.
        bin: height of the bins of a column, m. The returns in a bin are averaged; one bin is centred on z = 0.
        levels: number of bins of a column.
        fewest: minimum number of returns in a bin, or of dropouts in a cell; fewer are noise.
        noise: share of a bin's returns that may stray into an adjacent bin.
        ray_height: a ray that passes at most this high above the ground of a cell shows that it contains no wall, m.
        start_radius: distance from the start within which the robot still assumes that the ground around the start is
            level, m.
        start_ahead: length of the strip in front of the robot that it assumes to be level at the start, m.
        dropouts: gaps in the depth image.
        overhangs: surfaces above the ground.
        traversability: where the robot may drive.
    """

    cell: float = 0.05
    lowest: float = -1.575
    bin: float = 0.05
    levels: int = 73
    fewest: int = 3
    noise: float = 0.1
    ray_height: float = 0.3
    start_radius: float = 0.2
    start_ahead: float = 1.4
    dropouts: DropoutConfig = DropoutConfig()
    overhangs: OverhangConfig = OverhangConfig()
    traversability: TraversabilityConfig = TraversabilityConfig()
