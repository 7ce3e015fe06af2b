"""Score a mission's files as the leagues do: ``score_mission.py DIR --arena A``."""

import json
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro

from pipeline.errors import InputError
from pipeline.files import read_numbers
from sarsim.arenas.settings import StartPose, WorldVictims
from sarsim.commands.cli import run
from sarsim.flags import Given
from sarsim.opengl import without_opengl
from sarsim.settings import RobotName


def score_mission(
    path: Annotated[Path, tyro.conf.Positional],
    arena: str,
    start: Given[StartPose] = None,
    robot: RobotName = "pioneer3at",
    mission: str = "league",
    parked: Given[tuple[float, float]] = None,
    resets: int = 0,
    contacts: int = 0,
    victims: Given[Path] = None,
    victims_state: Literal["alive", "dead"] = "dead",
) -> None:
    """Compare a team's 3D map and list of finds with the arena, and print the leagues' scores.

    Args:
        path: folder of the files, or an episode's folder that contains handed_in/.
        arena: arena that was mapped, as for sarsim-episode.
        start: start pose: x and y in m, yaw in degrees. By default the arena's own start.
        robot: robot that drove: pioneer3at, jackal, or the path of an MJCF file.
        mission: league, virtual, or the path of a YAML file of rewards and penalties.
        parked: x and y of the robot at the end, m. By default the end of trajectory_true.tum.
        resets: number of times that someone touched the robot.
        contacts: number of contacts with living victims.
        victims: list of the victims and starts of a published world, as for sarsim-episode.
        victims_state: state of the victims whose names do not say whether they are alive.
    """
    with without_opengl():
        from dm_control import mjcf

        from sarsim.methods.arena import make_arena
        from sarsim.plugins.league.handed_in import score_handed_in, true_arena
        from sarsim.plugins.league.plugin import load_mission
        from sarsim.robots.model import robot_model

    for flag, count in (("resets", resets), ("contacts", contacts)):
        if count < 0:
            raise InputError(f"--{flag} {count}: must not be negative")
    brief, body = load_mission(mission), robot_model(robot)
    world = make_arena(arena, start, victims=WorldVictims(victims, victims_state))
    physics = mjcf.Physics.from_mjcf_model(world.mjcf_model)
    with world.prefixing_errors():
        truth = true_arena(physics.model.ptr, physics.data.ptr, world.T_world_start, body)
    end, driven = None if parked is None else np.array(parked), path / "trajectory_true.tum"
    if end is None and driven.exists():
        end = read_numbers(driven, "t x y z qx qy qz qw")[-1, 1:3]
    print(json.dumps(score_handed_in(path, truth, brief, end, resets, contacts), indent=1))


def main() -> None:
    """Entry point of ``sarsim-score-mission``."""
    run(score_mission)
