"""The leagues' scores of a mission of the simulated robot."""

from pathlib import Path

import mujoco

from pipeline.plugins.league.brief import MissionBrief
from pipeline.plugins.league.validation import handed_in_files
from pipeline.sink import Result, Sink
from sarsim.scoring.handed_in import score_handed_in, true_arena
from sarsim.scoring.leagues import Rule
from sarsim.simulated_robot import SimulatedRobot


class MissionScore(Sink):
    """Adds the scores of the files that an episode handed in to its report."""

    finishing = "scoring the mission"

    def __init__(self, robot: SimulatedRobot, brief: MissionBrief):
        self._robot, self._brief = robot, brief

    def finish(self, result: Result) -> None:
        """Score the files as a judge would, who has only them."""
        if result.is_reported:
            result.add(mission_score(result.folder, self._robot, self._brief))


def mission_score(folder: Path, robot: SimulatedRobot, brief: MissionBrief) -> dict[str, dict[str, Rule]]:
    """The leagues' scores of an episode, as returned by :func:`score_handed_in`; empty if it handed in no files.

    Nobody touches the robot, so there are no resets.
    """
    files = handed_in_files(folder)
    if not (files[".ply"] and files[".csv"]):
        return {}
    model = robot.physics.model.ptr
    before = mujoco.MjData(model)  # the arena before the robot moved anything
    mujoco.mj_forward(model, before)
    truth = true_arena(model, before, robot.T_world_start, robot.model, robot.base_body)
    parked = robot.trajectory[-1].T_world_base[:2, 3]
    return score_handed_in(folder, truth, brief, parked, contacts=robot.collisions.with_living)
