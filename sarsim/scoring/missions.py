"""What a mission of the simulated robot is worth to the leagues."""

from dm_control import mjcf

from pipeline.missions.brief import MissionBrief
from pipeline.missions.validation import handed_in_files
from sarsim.arenas.fiducials import hang_fiducials
from sarsim.arenas.load import load_arena
from sarsim.scoring.handed_in import score_handed_in, true_arena
from sarsim.scoring.leagues import Rule
from sarsim.settings import EpisodeConfig
from sarsim.simulated_robot import SimulatedRobot


def mission_score(config: EpisodeConfig, robot: SimulatedRobot, brief: MissionBrief) -> dict[str, dict[str, Rule]]:
    """Both leagues' scores, ``league`` and ``virtual``, of what an episode has handed in; none without its files.

    Nobody touches the robot, so there are no resets.
    """
    files = handed_in_files(config.folder)
    if not (files[".ply"] and files[".csv"]):
        return {}
    arena = load_arena(config.arena, config.start, config.random)
    hang_fiducials(arena, config.fiducials, config.seed)
    physics = mjcf.Physics.from_mjcf_model(arena.mjcf_model)
    truth = true_arena(physics.model.ptr, physics.data.ptr, arena.T_world_start, robot.model)
    parked = robot.trajectory[-1].T_world_base[:2, 3]
    return score_handed_in(config.folder, truth, brief, parked, contacts=robot.collisions.with_living)
