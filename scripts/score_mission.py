"""Score a mission's files as the leagues do: ``score_mission.py DIR --arena A``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from pipeline.errors import InputError
from sarsim.arenas.settings import StartPose
from sarsim.scripts.settings import load_mission, run_with_settings
from sarsim.settings import Robot


@dataclass(frozen=True)
class ScoreMission:
    """What is scored, and where it was driven.

    Attributes:
        path: folder of the files, or an episode's that contains handed_in/.
        arena: as in run_episode.py.
        start: start pose: x and y in m, yaw in degrees; by default the arena's own.
        robot: that drove: pioneer3at, jackal, or the path of an MJCF file.
        mission: league, virtual, or the path of a YAML file with rewards and penalties.
        parked: x and y in m where the robot was at the end; by default the end of trajectory_true.tum.
        resets: how often the robot was touched.
        contacts: contacts with living victims.
    """

    path: Annotated[Path, tyro.conf.Positional]
    arena: str
    start: StartPose | None = None
    robot: Robot = "pioneer3at"
    mission: str = "league"
    parked: tuple[float, float] | None = None
    resets: int = 0
    contacts: int = 0


def score_mission(settings: ScoreMission) -> None:
    """Compare the 3D map and the list of finds of a team with the arena, and print both leagues' scores."""
    import json

    import numpy as np
    from dm_control import mjcf

    from pipeline.files import read_numbers
    from sarsim.arenas.load import load_arena
    from sarsim.robots.model import robot_model
    from sarsim.scoring.handed_in import score_handed_in, true_arena

    if min(settings.resets, settings.contacts) < 0:
        raise InputError("--resets and --contacts: numbers of at least 0")
    brief, robot = load_mission(settings.mission), robot_model(settings.robot)
    arena = load_arena(settings.arena, settings.start)
    physics = mjcf.Physics.from_mjcf_model(arena.mjcf_model)
    known = true_arena(physics.model.ptr, physics.data.ptr, arena.T_world_start, robot)
    parked, driven = settings.parked, settings.path / "trajectory_true.tum"
    if parked is None and driven.exists():
        parked = tuple(read_numbers(driven, "t x y z qx qy qz qw")[-1, 1:3])
    where = None if parked is None else np.array(parked)
    print(
        json.dumps(score_handed_in(settings.path, known, brief, where, settings.resets, settings.contacts), indent=1)
    )


def main() -> None:
    """Entry point."""
    run_with_settings(score_mission, ScoreMission)


if __name__ == "__main__":
    main()
