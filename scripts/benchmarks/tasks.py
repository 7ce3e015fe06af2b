"""Step rates of the tasks, and path lengths of the 2D explorers under the papers' protocol.

Rates are steps per second of processor time, so that other load on the machine does not count; two processes are
timed by wall clock.
"""

import time
from collections.abc import Sequence

import gymnasium
import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.stats import bootstrap

from sarsim.commands.cli import tracked
from sarsim.environment import CONTROL_TIMESTEP
from sarsim.sensors.camera import optical_pose
from sarsim.tasks.drive import PERIODS, Drive
from sarsim.tasks.explore_2d import Explore2D
from sarsim.tasks.grid_explorers import EXPLORERS, explore
from sarsim.tasks.grid_scenes import DRAWINGS, SIZES, GridScene, draw_scene, dungeon_files, read_dungeon
from sarsim.tasks.grid_world import PAPERS, GridWorld
from scripts.benchmarks.common import Result, at_least
from scripts.benchmarks.settings import TasksSettings

COMPARED = "viewpoint_tour"
"""The explorer whose path lengths are compared with those of the others."""
INTERVAL_SHARE = 0.95


def measure(settings: TasksSettings) -> Result:
    """Steps per second; and the mean path length of each explorer and ratios of them, with 95 % intervals."""
    at_least(1, settings, "steps")
    at_least(0, settings, "drawn")
    figures = {"explore2d.steps_per_s": steps_per_s(settings.steps)}
    figures |= drive_rates(settings.steps // 4)
    figures["two_processes_vs_one"] = vector_rate(2, settings.steps) / vector_rate(1, settings.steps)
    groups = {"drawn": [draw_scene(DRAWINGS["test"] + n, *SIZES["papers"]) for n in range(settings.drawn)]}
    groups["dungeons"] = [read_dungeon(path) for path in dungeon_files(settings.maps)] if settings.maps else []
    for group, scenes in groups.items():
        if len(scenes) > 1:
            figures |= {f"{group}.{name}": value for name, value in compare(scenes, group).items()}
    return Result(figures)


def steps_per_s(steps: int) -> float:
    """Steps per second of processor time of Explore2D, with random viewpoints."""
    env, rng = Explore2D(), np.random.default_rng(0)
    _, info = env.reset(seed=0)
    env.step(0)  # compiles
    start = time.process_time()
    for _ in range(steps):
        _, _, is_over, is_cut, info = env.step(int(rng.integers(info["action_mask"].sum())))
        if is_over or is_cut:
            _, info = env.reset()
    return steps / (time.process_time() - start)


def drive_rates(steps: int) -> dict[str, float]:
    """Rate of Drive over that of MuJoCo's steps alone; with depth, over that of MuJoCo's steps and a ray cast."""
    shares = dict[str, float]()
    for name, size in {"drive.over_mujoco": None, "drive.depth84_over_floor": (84, 84)}.items():
        env = Drive(depth=size, seconds=steps)
        env.reset(seed=0)
        env.step(np.zeros(2, np.float32))
        task, floor = 0.0, 0.0
        for n in range(steps):  # alternating, so that load and contacts affect both alike
            action = np.array([0.3 * (-1) ** (n // 10), 0.2], np.float32)
            start = time.process_time()
            env.step(action)
            middle = time.process_time()
            steps_alone(env)
            floor += time.process_time() - middle
            task += middle - start
        shares[name] = floor / task
        env.close()
    return shares


def steps_alone(env: Drive) -> None:
    """Do the minimum work of a step: MuJoCo's own steps, and a ray cast if there is a camera."""
    assert env.world is not None
    model, data = env.world.physics.model.ptr, env.world.physics.data.ptr
    mujoco.mj_step(model, data, nstep=PERIODS * round(CONTROL_TIMESTEP / model.opt.timestep))
    if env.rays is not None:
        env.rays.depth(optical_pose(data, env.camera))


def vector_rate(processes: int, steps: int) -> float:
    """Steps per second of wall-clock time of several environments, each in its own process."""
    envs = gymnasium.make_vec("sarsim/Explore2D-v0", num_envs=processes, vectorization_mode="async")
    rng = np.random.default_rng(0)
    envs.reset(seed=0)
    envs.step(np.zeros(processes, np.int64))
    start = time.perf_counter()
    for _ in range(steps):
        envs.step(rng.integers(0, 4, processes))
    rate = processes * steps / (time.perf_counter() - start)
    envs.close()
    return rate


def compare(scenes: Sequence[GridScene], group: str) -> dict[str, float]:
    """Mean path lengths, and the ratio of ``COMPARED``'s mean to that of each other explorer, with intervals."""
    ways, explored = dict[str, NDArray[np.float64]](), dict[str, float]()
    for name in tracked(list(EXPLORERS), f"exploring {group}"):
        worlds = [GridWorld(scene, PAPERS) for scene in scenes]
        for n, world in enumerate(worlds):
            explore(world, EXPLORERS[name], np.random.default_rng(n))
        ways[name] = np.array([world.way for world in worlds])
        explored[name] = float(np.mean([world.is_explored for world in worlds]))
    figures = dict[str, float]()
    for name, way in ways.items():
        figures |= interval(f"{name}.way", way, np.ones(len(way)))
        figures[f"{name}.way.std"], figures[f"{name}.explored"] = float(way.std(ddof=1)), explored[name]
        if name != COMPARED:
            figures |= interval(f"{COMPARED}_over_{name}", ways[COMPARED], way)
    return figures


def interval(name: str, above: NDArray[np.float64], below: NDArray[np.float64]) -> dict[str, float]:
    """Ratio of the sums of ``above`` and ``below``, (N,) each, and its 95 % percentile bootstrap interval."""

    def ratio(a: NDArray[np.float64], b: NDArray[np.float64], axis: int = -1) -> NDArray[np.float64]:
        return np.asarray(a.sum(axis=axis) / b.sum(axis=axis))

    found = bootstrap(
        (above, below),
        ratio,
        paired=True,
        confidence_level=INTERVAL_SHARE,
        method="percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return {name: float(ratio(above, below)), f"{name}.low": float(found.low), f"{name}.high": float(found.high)}
