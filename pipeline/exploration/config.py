"""The numbers of the exploration: what views are expected to show, when they are worth a drive, and of missions."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class VisibilityConfig:
    """Which unseen ground a view is expected to show.

    Attributes:
        rays: number of directions around a place in which rays are cast.
        stride: cells along each side of the blocks, each of which has one place for viewpoints.
        short_by: m by which the robot may stop short of a viewpoint, so that it sees less far.
        ramp_slope: slope above which ground is a ramp; 8°.
        nist_slope: slope of a NIST ramp: at least so steeply falls ground that a keyframe missed.
        blocked: probability that a ray was blocked up to which it is expected to go on through unknown ground.
        least_unknown: m of unknown ground that it is expected to see through even in the narrowest places.
        level_run: m of level ground after which a ramp's fall has ended.
        new_view: m; from a place nearer to the last keyframe that missed a cell, the cell is not expected to be seen.
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
    """Which walls a keyframe has shown well enough, and from where others are looked at.

    Attributes:
        square: depths along each side of the squares of an image of which each is a piece of wall.
        flatness: deviation of a piece's points from its plane that is too much, in standard deviations of the depth.
        upright: greatest upward component of a piece's normal.
        highest: m above the ground up to which signs and other finds hang on walls.
        sign: m, side of the median sign, as the leagues print hazmat signs.
        readable: pixels across that sign at which it can be read.
        before: m from a wall to the places that stand for it: of its two sides they are as far apart as finds may be.
        spacing: m between such places; those this close to one that was read or aimed at are done.
        depth: m in front of a wall that count as free along a line of sight.
        beside_camera: m of a line of sight that count as free because the robot itself will stand there.
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
    """How ways to goals through unseen ground are looked for.

    Attributes:
        margin: m around a goal in which a way may lead round what is before it.
        farthest: m from the robot to a goal; only seen ground leads to one farther away, for the time and the memory
            of the search grow with the area.
        ahead: m of the unseen way that a view is to show.
        second_look: s that another view costs where one shows nothing of these.
        detour: s of a detour within which views are looked for at first; farther ones where there are none.
        least_share: of these that a view must show to be worth it.
        alternatives: most ways through different unseen ground that are compared.
        tries: keyframes that missed ground after which it does not count as free any more,
        drives: and drives to views of it, wherever they ended.
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
        keyframe_time: s that a keyframe costs in addition to the way.
        more_ground: factor by which the ground seen must grow at least,
        more_time: while the time of the run grows by this factor.
        horizon: s of driving up to which ways to viewpoints are searched for at first; doubled as long as needed.
        arrived: m; a robot this close to a viewpoint or goal has reached it.
        patience: drives that bring the robot no nearer after which a goal is given up.
        looks: at what bars the way to seen ground, after which the robot takes it for barred.
        progress: s by which the way to a goal must shrink to count as nearer: the cost of a bend.
        shown: share of the expected ground after which a viewpoint has shown enough, even on the way to it.
        visibility: what a view is expected to show.
        unseen_ways: of ways to goals through unseen ground.
        inspection: of walls, once nothing is left to explore.
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
