"""The numbers of the exploration: what views are expected to show, when they are worth a drive, and of missions."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class VisibilityConfig:
    """Which unseen ground a view is expected to show.

    Attributes:
        rays: number of directions around a place in which rays are cast.
        stride: cells along each side of the blocks, each of which has one place for viewpoints.
        short_by: m by which the robot may stop short of a viewpoint, and then sees less far.
        ramp_slope: slope above which ground is a ramp; 8°.
        nist_slope: slope of a NIST ramp. Ground missed by a keyframe is assumed to fall at least this steeply.
        blocked: a ray is expected to cross unknown ground until a wall has stopped it with this probability.
        least_unknown: m, unknown ground that a ray is expected to cross even between the closest walls.
        level_run: m of level ground after which a ramp is taken to have ended.
        new_view: m; a cell that a keyframe missed is not expected to be seen from places closer than this to that
            keyframe.
    """

    rays: int = 180
    stride: int = 5
    short_by: float = 0.3
    ramp_slope: float = float(np.tan(np.deg2rad(8)))
    nist_slope: float = float(2 * np.tan(np.deg2rad(8)))
    blocked: float = 0.4
    least_unknown: float = 1.0
    level_run: float = 1.0
    new_view: float = 0.3


@dataclass(frozen=True)
class InspectionConfig:
    """Which walls a keyframe has shown well enough, and where to stand to inspect the others.

    Attributes:
        square: depth values along each side of an image square; each square is a piece of wall.
        flatness: deviation of points from their plane above which a piece is rejected, in standard deviations of the
            depth.
        upright: greatest upward component of a piece's normal.
        highest: m above the ground; signs and other finds hang no higher.
        sign: m, side of a typical sign, as the leagues print hazmat signs.
        readable: pixels across such a sign from which it can be read.
        before: m from a wall to the points that represent it, so that those of its two sides are as far apart as
            finds may be.
        spacing: m between such points; those this close to a point that was read or aimed at count as inspected.
        depth: m in front of a wall that a line of sight need not check.
        beside_camera: m next to the camera that a line of sight need not check: the robot itself will stand there.
    """

    square: int = 8
    flatness: float = 2.0
    upright: float = 0.5
    highest: float = 2.0
    sign: float = 0.2
    readable: float = 60.0
    before: float = 0.3
    spacing: float = 0.3
    depth: float = 0.3
    beside_camera: float = 0.3


@dataclass(frozen=True)
class UnseenWaysConfig:
    """How the robot searches for routes to goals through unseen ground.

    Attributes:
        margin: m around a goal within which a route may go around obstacles.
        farthest: m from the robot to a goal. Goals farther away are reached over seen ground only, because the time
            and memory of the search grow with the area.
        ahead: m of the unseen route that a view should show.
        second_look: s, cost of a second view if the first one shows none of this ground.
        detour: s, longest detour for a view; longer ones are considered only if there is none within it.
        least_share: share of this ground that a view must show.
        alternatives: greatest number of routes through different unseen ground that are compared.
        tries: number of keyframes that may miss ground before it no longer counts as free.
        drives: number of drives to views of that ground, wherever they ended, with the same effect.
    """

    margin: float = 3.0
    farthest: float = 60.0
    ahead: float = 1.5
    second_look: float = 5.0
    detour: float = 20.0
    least_share: float = 0.2
    alternatives: int = 3
    tries: int = 5
    drives: int = 8


@dataclass(frozen=True)
class ExplorationConfig:
    """When a viewpoint is worth a drive, and when a drive has ended.

    Exploring ends where ``more_time`` would show less than ``more_ground``. In foraging, equal factors are where the
    marginal value theorem (Charnov 1976) leaves a patch for another; here the other choice is to end.

    Attributes:
        keyframe_time: s that a keyframe takes, in addition to the drive.
        more_ground: least factor by which the seen ground must grow
        more_time: while the time of the run grows by this factor.
        horizon: s of driving within which viewpoints are searched for at first; doubled as long as needed.
        arrived: m; a robot this close to a viewpoint or goal has reached it.
        patience: number of drives without progress towards a goal after which it is given up.
        looks: number of looks at what blocks the route to seen ground, after which the robot takes it for blocked.
        progress: s by which the route to a goal must shrink to count as progress: the cost of a bend.
        shown: share of the expected ground that must be seen for a viewpoint to count as done, even on the way to it.
        visibility: what a view is expected to show.
        unseen_ways: routes to goals through unseen ground.
        inspection: of walls, when exploration is finished.
    """

    keyframe_time: float = 2.0
    more_ground: float = 1.002
    more_time: float = 1.15
    horizon: float = 1.5
    arrived: float = 0.15
    patience: int = 5
    looks: int = 3
    progress: float = 1.5
    shown: float = 0.8
    visibility: VisibilityConfig = VisibilityConfig()
    unseen_ways: UnseenWaysConfig = UnseenWaysConfig()
    inspection: InspectionConfig = InspectionConfig()
