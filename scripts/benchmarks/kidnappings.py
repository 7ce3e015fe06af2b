"""Kidnap a robot repeatedly, and check whether it notices each kidnapping and relocalises."""

from collections import Counter
from dataclasses import replace
from pathlib import Path
from shutil import rmtree

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Place
from pipeline.errors import InputError
from pipeline.explorer import Explorer
from pipeline.localisation.localisation import LostError
from pipeline.map_file import KEYFRAMES
from pipeline.robot import Velocity
from pipeline.transforms import inverse
from sarsim.composition import TRUE_LABELS, make_mapper
from sarsim.episode import Episode
from sarsim.settings import EpisodeConfig
from sarsim.simulated_robot import SimulatedRobot

FREE_RADIUS = 0.4  # m, radius of free ground needed around the position where the robot is set down
MIN_CARRY_DISTANCE = 0.5  # m, minimum distance by which the robot is carried
STANDING_TIME = 10.0  # s, time for which the robot stands still after being set down, while its roll and pitch settle
FOUND_ERROR, WRONG_ERROR = 0.05, 0.3
"""Position errors, m: a pose with an error below the first is found, a pose with at least the second is wrong."""
OUTCOMES = "found", "found_worse", "wrong", "in_doubt", "not_noticed"


def kidnap(config: EpisodeConfig, times: int, folder: Path) -> Counter[str]:
    """Kidnap a robot ``times`` times, and return the number of kidnappings with each of ``OUTCOMES``.

    An episode explores first, unless its map exists in ``folder``. In this map, the robot is then carried to random
    mapped positions. After a wrong or doubtful pose, or an unnoticed kidnapping, the robot restarts at its true pose.
    """
    if not (folder / KEYFRAMES).exists():
        Episode(replace(config, out=folder)).run(show_progress=False)
    out = folder / "kidnapped"
    rmtree(out, ignore_errors=True)
    episode = Episode(replace(config, out=out, map=folder))
    robot, counts, rng = episode.robot, Counter(dict.fromkeys(OUTCOMES, 0)), np.random.default_rng(config.seed)
    explorer = new_explorer(episode, folder)
    for _ in range(times):
        carry(episode, rng)
        outcome = step_outcome(explorer, episode)
        counts[outcome] += 1
        if outcome in OUTCOMES[2:]:
            explorer = new_explorer(episode, folder)
    episode.recorder.close()
    robot.close()
    return counts


def new_explorer(episode: Episode, folder: Path) -> Explorer:
    """A new explorer that starts at the robot's true pose in the map."""
    robot, config = episode.robot, episode.config
    mapper = make_mapper(replace(TRUE_LABELS, labels=config.labels), robot.model, config.seed, earlier=folder)
    explorer, frame = Explorer(robot, mapper), robot.sense()
    mapper.localisation.set_pose(robot.trajectory[-1].T_world_base)
    mapper.add_frame(mapper.localise(frame), labelled=True)
    explorer.pilot.navigator.add_motion(robot.drive(Velocity()))
    explorer.pilot.confirm(mapper.localise(robot.sense()))  # the last view before the robot is carried
    return explorer


def carry(episode: Episode, rng: np.random.Generator) -> None:
    """Set the robot down elsewhere and let it settle; InputError if there is no free place."""
    robot, surface = episode.robot, episode.score.surface
    free = ndimage.binary_erosion(surface.drivable, iterations=round(FREE_RADIUS / surface.grid.cell))
    cells = np.argwhere(free & episode.score.coverage.seen)
    places = surface.grid.centre_of(cells)
    far = np.linalg.norm(places - robot.trajectory[-1].T_world_base[:2, 3], axis=1) > MIN_CARRY_DISTANCE
    if not far.any():
        raise InputError(
            f"{episode.config.arena}: the mapped area has no free place more than {MIN_CARRY_DISTANCE:g} m from the"
            " robot"
        )
    n, yaw = rng.choice(np.flatnonzero(far)), rng.uniform(-np.pi, np.pi)
    place = np.append(places[n], surface.height[tuple(cells[n])] + 0.01)
    set_down(robot, place, np.array([np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)]), STANDING_TIME)


def set_down(robot: SimulatedRobot, place: Place, quat: NDArray[np.float64], seconds: float) -> None:
    """Set a robot down at a position (3,), m, with a quaternion (4,), and let it stand still for ``seconds``."""
    robot.robot.set_pose(robot.physics, place, quat)
    robot.physics.velocity()[:] = 0
    mujoco.mj_forward(robot.physics.model.ptr, robot.physics.data.ptr)
    for _ in range(round(seconds / robot.control_period)):
        robot.drive(Velocity())


def step_outcome(explorer: Explorer, episode: Episode) -> str:
    """One of ``OUTCOMES``, judged from the pose that the explorer estimates in its next step."""
    found = explorer.pilot.pose_check.relocalised
    try:
        T_map_base = explorer.step().keyframe.T_map_base
    except LostError:
        return "in_doubt"
    error = np.linalg.norm((inverse(episode.robot.trajectory[-1].T_world_base) @ T_map_base)[:3, 3])
    if explorer.pilot.pose_check.relocalised == found and error > WRONG_ERROR:
        return "not_noticed"
    return "found" if error < FOUND_ERROR else "found_worse" if error < WRONG_ERROR else "wrong"
