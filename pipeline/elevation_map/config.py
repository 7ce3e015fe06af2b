"""The numbers of the elevation map, of where the robot may drive by it, and of what drives cost."""

from dataclasses import dataclass
from math import radians


@dataclass(frozen=True)
class DropoutConfig:
    """Which gaps in the depth image may hide a thin panel.

    Attributes:
        fewest: pixels and rows, the least extent of a gap; smaller ones are noise.
        widest: pixels, the greatest width of a gap; wider ones leave unknown ground behind them.
        row_step: rows from one searched row to the next.
    """

    fewest: int = 3
    widest: int = 60
    row_step: int = 2


@dataclass(frozen=True)
class OverhangConfig:
    """Which surfaces hide the space above the ground, so that something too low for the robot may hang there.

    Attributes:
        nearer: m by which a surface must be nearer than the space that it hides: the surface itself is in the map.
        deviations: standard deviations of the sensor's noise that do not count, besides.
        reach: m, farthest that an overhang goes on behind its edge.
        fewest: pixels one above the other that must show it; fewer are noise of an edge.
        beside: m to either side where it must go on, with ground below: upright edges hide what is behind them, too.
    """

    nearer: float = 0.05
    deviations: float = 3.0
    reach: float = 2.0
    fewest: int = 2
    beside: float = 0.05


@dataclass(frozen=True)
class PathCosts:
    """What driving costs, in seconds, besides what follows from the robot.

    Attributes:
        comfort: m of room around the footprint from which on the robot drives as fast as it can; more makes no
            difference, so clearances are computed up to here.
        narrow_stop: m in which the robot can stop where obstacles leave no room around its footprint; a Pioneer then
            drives at 0.2 m/s.
        ramp_pace: share of its speed, and of its turn rate, that the robot reaches on ramps, where it aligns itself
            and slips.
        turn_pace: share of its greatest turn rate that the robot reaches, since it speeds up and brakes.
        stray: m, greatest deviation of the robot from its way.
        backing: cost of a drive backwards, relative to one forwards: the camera looks the other way.
        risk: s added to each second in which the robot is certain to meet an obstacle.
        stop: s that a bend of the way takes: slow down, set off again.
        tick: s, the unit in which the search counts.
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
        surface_slope, surface_rise: of neighbours that differ by more than this m per m and these m besides, one
            belongs to another surface (a wall, the floor under a deck) and does not count for the slope.
        drop_gap: m, greatest width of unknown ground between the two sides of a drop.
        ramp_tilt: rad; steeper ground is a ramp.
        ramp_margin: m; this close to a ramp the robot minds it, for its wheels may already be on it.
        leniency: m by which the robot may come nearer to unknown ground than to a hazard.
        turn_leniency: m by which a turn to the next heading may come nearer to an obstacle than a pose.
        least_driven: m, least clearance where the middle of the robot has been, so that noise of later keyframes
            does not shut it in.
        deepest_driven: share of half of the robot's width; an obstacle so far inside the footprint counts even there,
            for no drift of the map moves it so far.
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
        lowest: m over where the robot was set down, the lowest height that matters to it.
        bin: m, height of the bins of a column, of which the returns are averaged; one is centred on z = 0.
        levels: number of bins of a column.
        fewest: returns, or dropouts, of a bin or cell that count; fewer are noise.
        noise: share of a bin's returns that may stray into the next one.
        ray_height: m; a ray that passes over a cell no higher above its ground shows that no wall stands there.
        start_radius: m from where it was set down within which the robot takes the ground for level until it is seen.
        start_ahead: m, length of the strip before the robot that it takes for level there.
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
        """m over where the robot was set down, up to which ground is mapped."""
        return self.lowest + self.levels * self.bin
