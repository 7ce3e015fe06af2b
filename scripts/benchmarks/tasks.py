"""Step rates of ``Drive-v0``, in processor time, so that other load on the machine has no effect.

The rates of one and of two processes are compared in wall-clock time.
"""

import time

import gymnasium
import mujoco
import numpy as np

from pipeline.errors import required
from sarsim.environment import CONTROL_TIMESTEP
from sarsim.sensors.camera import optical_pose
from sarsim.tasks.drive import PERIODS_PER_STEP, Drive
from scripts.benchmarks.common import Result, check_at_least
from scripts.benchmarks.settings import TasksSettings


def measure(settings: TasksSettings) -> Result:
    """The step rate relative to the necessary work alone, and the rate of two processes relative to one process."""
    check_at_least(1, settings, "steps")
    figures = drive_rates(settings.steps)
    figures["two_processes_vs_one"] = vector_rate(2, settings.steps) / vector_rate(1, settings.steps)
    return Result(figures)


def drive_rates(steps: int) -> dict[str, float]:
    """Ratios of Drive's rate to the rate of MuJoCo's steps alone or, with depth, of MuJoCo's steps and a ray cast."""
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
    physics = required(env.world).physics
    model, data = physics.model.ptr, physics.data.ptr
    mujoco.mj_step(model, data, nstep=PERIODS_PER_STEP * round(CONTROL_TIMESTEP / model.opt.timestep))
    if env.rays is not None:
        env.rays.depth(optical_pose(data, env.camera_id))


def vector_rate(processes: int, steps: int) -> float:
    """Steps per second of wall-clock time of several environments, each in its own process."""
    envs = gymnasium.make_vec("sarsim.tasks:sarsim/Drive-v0", num_envs=processes, vectorization_mode="async")
    envs.reset(seed=0)
    actions = np.tile(np.array([0.3, 0.2], np.float32), (processes, 1))
    envs.step(actions)
    start = time.perf_counter()
    for _ in range(steps):
        envs.step(actions)
    rate = processes * steps / (time.perf_counter() - start)
    envs.close()
    return rate
