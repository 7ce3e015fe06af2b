"""The lanes of ``assets/arenas/lanes``, and what each asks of a robot's body."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the lanes' names are wanted before anything that takes seconds to import
    from pipeline.robot import RobotModel

LANES_FOLDER = "lanes/"
LANE_SLOPE = 15.0  # degrees
END_ZONE = 1.2  # m, from the middle of a lane to where each end zone begins, which is as long
LANE_RISE = 2 * END_ZONE * math.tan(math.radians(LANE_SLOPE))  # m, of a slope from one end zone to the other
ROBOT_PASSAGE = 0.597  # m, the width of a Pioneer 3-AT and 10 cm
GATE = 0.9  # m, width of doors and of the gates between holes


@dataclass(frozen=True)
class Lane:
    """What a lane asks of whoever drives through it.

    Attributes:
        step: height of the lowest step that no way avoids, m.
        slope: tilt of the ground that no way avoids, degrees.
        passage: width of the narrowest passage, m; infinite if there is none.
        rise: how much higher than the end zone at -x that at +x lies, m.
    """

    step: float = 0.0
    slope: float = 0.0
    passage: float = math.inf
    rise: float = 0.0

    def cannot(self, robot: "RobotModel") -> str | None:
        """Why a robot's body is not made for it, with the numbers that say so; None if it is."""
        if self.step > robot.max_step:
            return f"a step of {self.step:g} m, at most {robot.max_step:g} m are driven over"
        if math.radians(self.slope) > robot.max_tilt:
            return f"a slope of {self.slope:g}°, at most {math.degrees(robot.max_tilt):.3g}° are driven on"
        if self.passage < robot.width:
            return f"a passage of {self.passage:g} m, the robot is {robot.width:g} m wide"
        return None


LANES = {
    "avoid_holes": Lane(passage=GATE),
    "centre": Lane(slope=LANE_SLOPE, passage=ROBOT_PASSAGE, rise=LANE_RISE),
    "crossing_ramps": Lane(slope=LANE_SLOPE),
    "door": Lane(passage=GATE),
    "hurdles": Lane(step=0.2),
    "krails": Lane(step=0.1),
    "krails_15": Lane(step=0.1, slope=LANE_SLOPE, rise=LANE_RISE),
    "stepfield": Lane(step=0.15),
    "traverse": Lane(slope=LANE_SLOPE, passage=ROBOT_PASSAGE),
}
"""By name."""
