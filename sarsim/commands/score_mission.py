"""Score a mission's files as the leagues do: ``score_mission.py DIR --arena A``."""

from pathlib import Path
from typing import Annotated

import tyro

from pipeline.errors import InputError
from sarsim.arenas.settings import StartPose
from sarsim.commands.cli import run
from sarsim.settings import Robot


def score_mission(
    path: Annotated[Path, tyro.conf.Positional],
    arena: str,
    start: StartPose | None = None,
    robot: Robot = "pioneer3at",
    mission: str = "league",
    parked: tuple[float, float] | None = None,
    resets: int = 0,
    contacts: int = 0,
) -> None:
    """Compare the 3D map and the list of finds of a team with the arena, and print the leagues' scores.

    Args:
        path: folder of the files, or an episode's that contains handed_in/.
        arena: that was mapped, as in run_episode.py.
        start: start pose: x and y in m, yaw in degrees; by default the arena's own.
        robot: that drove: pioneer3at, jackal, or the path of an MJCF file.
        mission: league, virtual, or the path of a YAML file with rewards and penalties.
        parked: x and y in m where the robot was at the end; by default the end of trajectory_true.tum.
        resets: how often the robot was touched.
        contacts: contacts with living victims.
    """
    import json

    import numpy as np
    from dm_control import mjcf

    from pipeline.files import read_numbers
    from sarsim.commands.settings import load_mission
    from sarsim.methods.arena import make_arena
    from sarsim.robots.model import robot_model
    from sarsim.scoring.handed_in import score_handed_in, true_arena

    if min(resets, contacts) < 0:
        raise InputError(f"--resets {resets} --contacts {contacts}: numbers of at least 0")
    brief, body, world = load_mission(mission), robot_model(robot), make_arena(arena, start)
    physics = mjcf.Physics.from_mjcf_model(world.mjcf_model)
    with world.naming():
        truth = true_arena(physics.model.ptr, physics.data.ptr, world.T_world_start, body)
    end, driven = None if parked is None else np.array(parked), path / "trajectory_true.tum"
    if end is None and driven.exists():
        end = read_numbers(driven, "t x y z qx qy qz qw")[-1, 1:3]
    print(json.dumps(score_handed_in(path, truth, brief, end, resets, contacts), indent=1))


def main() -> None:
    """Entry point."""
    run(score_mission)
