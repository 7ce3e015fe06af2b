"""The lanes of RoboCup Rescue: their dimensions, and the demands of each on a robot's body."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the names of lanes must be available without slow imports
    from pipeline.robot import RobotModel

MAZE = "maze"
"""Name of the search-and-map maze, which is listed with the lanes although no robot has to traverse it."""


@dataclass(frozen=True)
class LaneConfig:
    """Dimensions of the lanes, in m and degrees.

    Unless stated otherwise, the source is RoboCup Rescue, Arena Fabrication Guide 2026C, as transcribed by teams.

    Attributes:
        floor: length of a framed floor along the lane; a lane has four floors.
        width: width of a lane.
        framing, board: heights of a floor's frame and of the board on it.
        offset: distance by which the end zones (the outer floors) are shifted sideways, in opposite directions.
        railing: width of a railing.
        bars: heights of the tops of a railing's bars.
        lumber: thickness and height of a 2×4 (US lumber), used for railings, posts and diagonals.
        slope: slope of floors and half ramps, degrees.
        half_ramp: length of the half ramps of the crossing ramps; assumed: half of a 1.2 m tile.
        rail: width and height of the diagonal rails.
        cell: side of the base of a step field's cell, and of a pitch/roll ramp.
        plateau: side of a step field's plateau; a cell has four.
        low, high: heights of the plateaus.
        ramp_height: height of a pitch/roll ramp at its high edge.
        passage: clear width next to the dividers: 0.1 more than the width of a Pioneer 3-AT (0.497, data sheet).
        panel: length and height of a sliding panel.
        pallet: height of a grid pallet; where the lane is raised, two are stacked.
        pipe: diameter and length of a pipe in front of a raised pallet.
        gate: width of doors and of the gates between posts.
        door: height of the door's leaf; assumed, like the height of the wall.
        wall: height of the wall with the door, and of the walls around the avoid-holes lane; assumed.
        leaf_mass: mass of the door's leaf, kg.
        leaf_angle: angle to which the leaf opens, degrees.
        leaf_spring: stiffness of the spring that shuts the door, Nm/rad; assumed.
        lever: height of the door's lever; assumed, as in buildings.
        hole_pallet: length, width and height of the pallets between the holes.
        post: height of the gates' posts.
        post_mass: mass of a post, kg; spruce of 450 kg/m³.
        wall_distance: distance from the pallets to the walls around them; assumed.
    """

    floor: float = 1.2
    width: float = 2.4
    framing: float = 0.1
    board: float = 0.011
    offset: float = 0.05
    railing: float = 1.2
    bars: tuple[float, ...] = (0.3, 0.6, 0.9)
    lumber: tuple[float, float] = (0.038, 0.089)
    slope: float = 15.0
    half_ramp: float = 0.6
    rail: float = 0.1
    cell: float = 0.594
    plateau: float = 0.297
    low: float = 0.15
    high: float = 0.3
    ramp_height: float = 0.15
    passage: float = 0.597
    panel: tuple[float, float] = (1.2, 0.8)
    pallet: float = 0.1
    pipe: tuple[float, float] = (0.1, 1.0)
    gate: float = 0.9
    door: float = 2.0
    wall: float = 1.2
    leaf_mass: float = 12.0
    leaf_angle: float = 100.0
    leaf_spring: float = 2.0
    lever: float = 1.0
    hole_pallet: tuple[float, float, float] = (1.2, 1.0, 0.14)
    post: float = 0.45
    post_mass: float = 0.7
    wall_distance: float = 0.3


DIMENSIONS = LaneConfig()
END_DISTANCE = (
    DIMENSIONS.floor
)  # m, from the centre of a lane to the start of each end zone, which has the same length


@dataclass(frozen=True)
class Lane:
    """The demands of a lane on a robot.

    Attributes:
        step: height of the step that cannot be avoided, m.
        twist: growth of the step height with lateral distance, where ramps meet only at such steps, m per m.
        slope: slope of the ground that cannot be avoided, degrees.
        passage: width of the narrowest passage, m; infinite if there is none.
        corner: width of the narrowest doorway in a corner, into which the robot must turn, m; infinite if none.
        lever: height of a lever that must be used to open a door, m; 0 if there is none.
        end_distance: distance from the centre of the lane to the start of each end zone, m.
    """

    step: float = 0.0
    twist: float = 0.0
    slope: float = 0.0
    passage: float = math.inf
    corner: float = math.inf
    lever: float = 0.0
    end_distance: float = END_DISTANCE

    def unsuitability(self, robot: "RobotModel") -> str | None:
        """Reason why the robot's body is unsuited to the lane, with the deciding numbers; None if it is suited."""
        step = max(self.step, self.twist * robot.width / 2)
        if step > robot.max_step:
            return f"a step of {step:.2g} m; the robot can climb at most {robot.max_step:g} m"
        if math.radians(self.slope) > robot.max_tilt:
            return f"a slope of {self.slope:g}°; the robot can drive on at most {math.degrees(robot.max_tilt):.3g}°"
        if self.passage < robot.width:
            return f"a passage of {self.passage:g} m; the robot is {robot.width:g} m wide"
        if self.corner < (room := robot.half_width + robot.corner_radius):
            return f"a doorway of {self.corner:g} m in a corner; to turn into it, the robot needs {room:.3f} m"
        if self.lever:
            return f"a lever {self.lever:g} m above the floor; the robot has no arm"
        return None

    @property
    def goal_distance(self) -> float:
        """Distance from the centre of the lane to the centre of each end zone, m."""
        return self.end_distance + DIMENSIONS.floor / 2


HOLES_END_DISTANCE = 3.5
"""m, the same for the lane with holes: 2.5 pallets of 1.2 m, and half the width, 1.0 m, of another."""

LANES = {
    "alleys": Lane(passage=DIMENSIONS.passage, corner=DIMENSIONS.passage),
    "avoid_holes": Lane(passage=DIMENSIONS.gate, end_distance=HOLES_END_DISTANCE),
    "centre": Lane(slope=DIMENSIONS.slope, passage=DIMENSIONS.passage, corner=DIMENSIONS.passage),
    "crossing_ramps": Lane(slope=DIMENSIONS.slope),
    "door": Lane(passage=DIMENSIONS.gate),
    "door_shut": Lane(passage=DIMENSIONS.gate, lever=DIMENSIONS.lever),
    "hurdles": Lane(step=DIMENSIONS.pallet),
    "krails": Lane(step=DIMENSIONS.rail),
    "krails_15": Lane(step=DIMENSIONS.rail, slope=DIMENSIONS.slope),
    "pitch_roll": Lane(twist=DIMENSIONS.ramp_height / DIMENSIONS.cell),
    "stepfield": Lane(step=DIMENSIONS.low),
    "traverse": Lane(slope=DIMENSIONS.slope, passage=DIMENSIONS.passage),
}
"""The lanes, by name."""
