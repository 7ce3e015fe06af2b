"""Parameters of exploration and missions: the ground that views are expected to show, and the worth of viewpoints."""

from dataclasses import dataclass

import numpy as np

from pipeline.errors import InputError, require_at_least, require_positive
from pipeline.labels import RAMP_TILT


@dataclass(frozen=True)
class VisibilityConfig:
    """Settings for predicting the unseen ground that a view will show.

    Attributes:
        rays: number of directions, all around a position, in which rays are cast.
        stride: side of the square blocks, cells; one cell of each block is a candidate for viewpoints.
        max_undershoot: maximum distance by which the robot may stop short of a viewpoint, m; the camera's range is
            reduced by it.
        max_overshoot: maximum distance by which the robot may come nearer than planned to ground that it looks at
            because this ground may block a path, m.
        nist_slope: slope of a NIST ramp, m per m; ground missed by a keyframe is assumed to fall at least this
            steeply.
        max_blocked_probability: maximum probability that a wall has stopped a ray in unknown ground for the ray to be
            followed further.
        min_unknown_length: minimum length of unknown ground that a ray is expected to see through, m, however close
            the walls are.
        level_run: length of level ground over which the fall assumed behind a NIST ramp decreases to 0, m.
        min_new_view_distance: minimum distance between a viewpoint that is expected to show a cell and the keyframe
            that last missed the cell, m.
    """

    rays: int = 180
    stride: int = 5
    max_undershoot: float = 0.3
    max_overshoot: float = 0.2
    nist_slope: float = float(2 * np.tan(RAMP_TILT))
    max_blocked_probability: float = 0.4
    min_unknown_length: float = 1.0
    level_run: float = 1.0
    min_new_view_distance: float = 0.3

    def __post_init__(self) -> None:
        require_positive("exploration.visibility", self, "level_run")
        require_at_least(0, "exploration.visibility", self, "max_undershoot", "max_overshoot")
        # The predicted field of view is two ray steps narrower than the camera's.
        require_at_least(36, "exploration.visibility", self, "rays")
        require_at_least(1, "exploration.visibility", self, "stride")


@dataclass(frozen=True)
class UnseenWaysConfig:
    """Settings of the search for paths to goals through unseen ground.

    Attributes:
        margin: distance from a goal within which the search also covers ground beyond the map, m.
        farthest: maximum distance from the robot to a goal, m. Goals farther away are reached over seen ground only,
            because the time and memory of the search grow with the area.
        view_length: length of the path through unseen ground that a view should show, m.
        second_look_cost: cost of a second view if the first shows none of this ground, s.
        detour: maximum detour for a view, s; longer detours are considered only if no view is within this limit.
        min_fraction: minimum fraction of this ground that a view must show.
        alternatives: maximum number of paths through different unseen ground that are compared.
        tries: number of keyframes that miss unseen ground after which it is treated as blocked.
        drives: number of drives to views of unseen ground, wherever they ended, after which this ground is treated as
            blocked.
    """

    margin: float = 3.0
    farthest: float = 60.0
    view_length: float = 1.5
    second_look_cost: float = 5.0
    detour: float = 20.0
    min_fraction: float = 0.2
    alternatives: int = 3
    tries: int = 5
    drives: int = 8

    def __post_init__(self) -> None:
        require_positive("exploration.unseen_ways", self, "farthest")
        require_at_least(1, "exploration.unseen_ways", self, "alternatives", "tries", "drives")


@dataclass(frozen=True)
class ExplorationConfig:
    """When a viewpoint is worth a drive, when a drive has reached its end, and when exploration ends.

    Exploration ends when increasing the run's time by the factor ``time_growth`` would increase the seen ground by
    less than the factor ``min_ground_growth``. With equal factors, this would be the marginal value theorem of
    foraging (Charnov 1976), which states when to leave a patch; here, the robot stops instead.

    Attributes:
        keyframe_time: time that a keyframe takes, in addition to the drive, s.
        min_ground_growth: minimum factor by which the seen ground must grow while the run's time grows by
            ``time_growth``.
        time_growth: see ``min_ground_growth``.
        max_given_up_fraction: maximum fraction of the seen ground that may be given up as not worth the drive.
        min_unreachable_area: minimum area of a piece of seen, unreachable ground that is reported as given up, m².
        horizon: driving time within which viewpoints are searched for at first, s; doubled as often as needed.
        goal_tolerance: distance within which a viewpoint or goal is considered reached, m.
        max_drives_without_progress: number of drives without progress towards a goal after which the goal is given
            up.
        max_unseen_gap: maximum width of unseen ground that is looked at because it may block a path, m.
        max_looks: number of looks after which a cell that may block the path to seen ground is treated as blocked.
        max_drives_to_look: number of drives to look at such a cell, wherever they ended, after which the cell is
            treated as blocked.
        min_progress: decrease in the time to a goal above which a drive has made progress, s; the default is the cost
            of a bend.
        min_shown_fraction: minimum fraction of the expected ground that must be seen, even if only during the drive,
            for a viewpoint to be done. Also, minimum gain of a view of cells that may block a path, as a fraction of
            the gain of the best such view.
        visibility: settings for the ground that a view is expected to show.
        unseen_ways: settings for paths to goals through unseen ground.
    """

    keyframe_time: float = 2.0
    min_ground_growth: float = 1.002
    time_growth: float = 1.15
    max_given_up_fraction: float = 0.01
    min_unreachable_area: float = 0.25
    horizon: float = 1.5
    goal_tolerance: float = 0.15
    max_drives_without_progress: int = 5
    max_unseen_gap: float = 0.5
    max_looks: int = 3
    max_drives_to_look: int = 8
    min_progress: float = 1.5
    min_shown_fraction: float = 0.8
    visibility: VisibilityConfig = VisibilityConfig()
    unseen_ways: UnseenWaysConfig = UnseenWaysConfig()

    def __post_init__(self) -> None:
        require_positive("exploration", self, "horizon", "keyframe_time")
        require_at_least(0, "exploration", self, "max_given_up_fraction", "min_unreachable_area", "max_unseen_gap")
        if not self.time_growth > 1:
            raise InputError(f"exploration.time_growth = {self.time_growth}: must be greater than 1")
        require_at_least(1, "exploration", self, "max_drives_without_progress", "max_looks", "max_drives_to_look")
