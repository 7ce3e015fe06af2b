"""The lanes and the maze as arenas: ``--arena lanes/NAME``."""

from dm_control import mjcf

from pipeline.errors import InputError
from sarsim.arenas.arena import RescueArena
from sarsim.plugins.lanes.lane_builders import build_lane
from sarsim.plugins.lanes.lanes import LANES, MAZE
from sarsim.plugins.lanes.maze import build_maze


def lane_arena(part: str, end: int = -1) -> RescueArena:
    """A lane, or the maze; the robot starts in the end zone at negative (``end`` = -1) or positive x of a lane.

    Raises:
        InputError: there is no such lane.
    """
    if part not in (*LANES, MAZE):
        raise InputError(f"unknown arena 'lanes/{part}': the lanes are {', '.join(LANES)} and {MAZE}")
    builder = build_maze() if part == MAZE else build_lane(part, end)
    return RescueArena(mjcf.from_xml_string(builder.to_xml(), assets=builder.files), f"lanes/{part}")
