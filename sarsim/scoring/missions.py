"""What a mission of the simulated robot is worth to the leagues."""

from pathlib import Path

import mujoco

from pipeline.league.brief import MissionBrief
from pipeline.league.validation import handed_in_files
from pipeline.sink import Result, Sink
from sarsim.scoring.handed_in import score_handed_in, true_arena
from sarsim.scoring.leagues import Rule
from sarsim.simulated_robot import SimulatedRobot


class MissionScore(Sink):
    """Adds what the files that an episode has handed in are worth to its report."""

    finishing = "scoring the mission"

    def __init__(self, robot: SimulatedRobot, brief: MissionBrief):
        self._robot, self._brief = robot, brief

    def finish(self, result: Result) -> None:
        """Score the files as a judge would, who has nothing else."""
        if result.is_reported:
            result.add(mission_score(result.folder, self._robot, self._brief))


def mission_score(folder: Path, robot: SimulatedRobot, brief: MissionBrief) -> dict[str, dict[str, Rule]]:
    """The leagues' scores, as of :func:`score_handed_in`, of an episode; none if it handed in no files.

    Nobody touches the robot, so there are no resets.
    """
    files = handed_in_files(folder)
    if not (files[".ply"] and files[".csv"]):
        return {}
    model = robot.physics.model.ptr
    before = mujoco.MjData(model)  # as the arena was, without what the robot moved
    mujoco.mj_forward(model, before)
    truth = true_arena(model, before, robot.T_world_start, robot.model, robot.base_body)
    parked = robot.trajectory[-1].T_world_base[:2, 3]
    return score_handed_in(folder, truth, brief, parked, contacts=robot.collisions.with_living)
