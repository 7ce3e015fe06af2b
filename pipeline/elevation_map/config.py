"""Settings of the elevation map, of traversability and of the cost of driving."""

from dataclasses import dataclass

from pipeline.errors import InputError, require_at_least, require_positive


@dataclass(frozen=True)
class PathCosts:
    """The costs of driving, in seconds, that do not follow from the robot's own data.

    Attributes:
        full_speed_clearance: free space around the footprint that lets the robot drive at full speed, m. More free
            space makes no difference, so clearances are computed only up to this distance.
        narrow_stopping_distance: stopping distance that limits the speed where obstacles leave no room around the
            footprint, m; a Pioneer then drives at 0.2 m/s.
        ramp_pace: fraction of the robot's ramp speed and turn rate that costs assume. It is lower than the fraction
            that the robot reaches, because the robot may slip and slide on ramps; expected durations do not include
            this risk.
        expected_ramp_pace: fraction of this speed and turn rate that the robot really reaches: a Pioneer and a Jackal
            reach 0.85 to 0.95 (measured in the simulator). The expected durations of drives assume it.
        turn_pace: fraction of the robot's maximum turn rate that it reaches on average, including acceleration and
            braking.
        max_path_deviation: maximum deviation of the robot from its path, m.
        backing: cost of driving backwards relative to driving forwards, because the camera then looks away from the
            direction of travel.
        collision_penalty: cost added per second of driving in which the robot is certain to hit an obstacle, s.
        bend: cost of a bend in the path, for braking and accelerating again, s.
    """

    full_speed_clearance: float = 0.2
    narrow_stopping_distance: float = 0.067
    ramp_pace: float = 0.65
    expected_ramp_pace: float = 0.9
    turn_pace: float = 0.42
    max_path_deviation: float = 0.1
    backing: float = 2.0
    collision_penalty: float = 20.0
    bend: float = 1.5

    def __post_init__(self) -> None:
        section = "elevation_map.traversability.costs"
        require_positive(section, self, "full_speed_clearance", "narrow_stopping_distance", "ramp_pace")
        require_positive(section, self, "expected_ramp_pace", "turn_pace", "backing")
        require_at_least(0, section, self, "max_path_deviation", "collision_penalty", "bend")


@dataclass(frozen=True)
class TraversabilityConfig:
    """Settings that determine where the robot may stand, turn and drive.

    Attributes:
        drop_gap: maximum width of unknown ground between the two sides of a drop, m.
        ramp_margin: distance to a ramp within which the robot drives as on the ramp, because its wheels may already
            be on it, m.
        leniency: distance by which the robot may come closer to unknown ground than to a hazard, m.
        min_tall_height: minimum height above the surrounding ground at which a hazard hides the ground behind it, m.
        keep_off: distance from people within which ground is treated as a hazard, m, because the hand of a person who
            lies on the floor is lower than a step.
        costs: costs of driving.
    """

    drop_gap: float = 0.6
    ramp_margin: float = 0.2
    leniency: float = 0.03
    min_tall_height: float = 0.4
    keep_off: float = 0.2
    costs: PathCosts = PathCosts()

    def __post_init__(self) -> None:
        names = "drop_gap", "ramp_margin", "leniency", "min_tall_height", "keep_off"
        require_at_least(0, "elevation_map.traversability", self, *names)


@dataclass(frozen=True)
class ElevationConfig:
    """Settings for determining the height of the ground.

    Attributes:
        cell: side of a cell, m.
        lowest: lowest height that is mapped, m, relative to the robot when it first sees a cell; negative. It is not
            relative to ``map``, because estimated heights drift over long drives, and slopes lead far up or down.
        bin: height of the bins of a column, m. The returns in a bin are averaged; one bin is centred on z = 0.
        levels: number of bins of a column.
        min_returns: minimum number of returns in a bin, or of dropouts in a cell; fewer are noise.
        start_ahead: length of the strip in front of the robot that it assumes to be level at the start, m.
        traversability: settings for where the robot may drive.
    """

    cell: float = 0.05
    lowest: float = -1.575
    bin: float = 0.05
    levels: int = 73
    min_returns: int = 3
    start_ahead: float = 1.4
    traversability: TraversabilityConfig = TraversabilityConfig()

    def __post_init__(self) -> None:
        require_positive("elevation_map", self, "cell", "bin", "start_ahead")
        require_at_least(1, "elevation_map", self, "min_returns")
        if not self.lowest < 0 < self.lowest + self.levels * self.bin:
            span = f"lowest = {self.lowest}, levels = {self.levels}, bin = {self.bin}"
            raise InputError(f"elevation_map: {span}: the column must begin below 0 and end above it")
