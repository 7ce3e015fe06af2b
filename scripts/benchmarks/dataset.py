"""The dataset generator against one that draws with ``mujoco.Renderer``'s three passes, and two workers against one.

Both generators make the same complete scenes: arena, drive, sensor's errors and file. They take turns frame by frame.
Each generator and each worker is one thread; the time in which it waits for a processor that other programs use does
not count, the time in which it waits for a disk or a graphics card does.
"""

import os
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from itertools import count
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sarsim.commands.cli import tracked
from sarsim.dataset.engine import JobDone
from sarsim.dataset.folder_lock import FolderLock
from sarsim.dataset.local_engine import Worker, wait_for
from sarsim.dataset.processes import connected
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.render import make_scene, render_scene
from scripts.benchmarks.common import RENDERERS, Result, at_least
from scripts.benchmarks.settings import DatasetSettings


def measure(settings: DatasetSettings) -> Result:
    """Times of each contender, and how many times faster ours and two workers are.

    Each contender makes its scenes after one that is not counted.

    Raises:
        InputError: a number is below 1.
    """
    at_least(1, settings, "scenes", "rounds")
    recipe = Recipe(seed=settings.seed, frames=settings.frames)
    times = {name: np.array(values) for name, values in _contest(recipe, settings.scenes).items()}
    figures = {
        f"frames_vs_{name}": float(values.sum() / times["ours"].sum())
        for name, values in times.items()
        if name != "ours"
    }
    undisturbed, clock = np.median(_scaling(recipe, settings.rounds), axis=0).tolist()
    figures |= {"two_workers_vs_one": undisturbed, "two_workers_vs_one.by_the_clock": clock}
    for name, values in times.items():
        figures[f"{name}.frames_per_s"] = float(values.size / values.sum())
        figures[f"{name}.frame_ms"] = float(1e3 * np.median(values))
    return Result(figures)


def _contest(recipe: Recipe, scenes: int) -> dict[str, list[float]]:
    """Seconds of every frame; the first one of a scene includes its arena and drive."""
    contenders = {name: connected(_serve, name, recipe) for name in RENDERERS}
    times: dict[str, list[float]] = {name: [] for name in RENDERERS}
    for frame in tracked(range((1 + scenes) * recipe.frames), "frames"):
        for name, (_, connection) in contenders.items():
            connection.send(None)
            elapsed = connection.recv()
            if frame >= recipe.frames:
                times[name].append(elapsed)
    for process, _ in contenders.values():
        process.kill()
        process.join()
    return times


def _scaling(recipe: Recipe, rounds: int) -> NDArray[np.float64]:
    """(rounds, 2) throughput of two workers over that of one: by undisturbed time, and by wall-clock time."""
    with tempfile.TemporaryDirectory() as name:
        folders = [Path(name, part) for part in "ab"]
        for folder in folders:
            folder.mkdir()
        with FolderLock.take(folders[0]) as lock:
            workers = [Worker(partial(make_scene, recipe), folder, lock) for folder in folders]
            _make(workers, 0)
            numbers = tracked(range(1, rounds + 1), "rounds")
            ratios = [2 * _make(workers[:1], index) / _make(workers, index) for index in numbers]
            for worker in workers:
                worker.end()
    return np.array(ratios)


def _make(workers: Sequence[Worker], index: int) -> NDArray[np.float64]:
    """(2,) seconds in which all workers make the same scene, each for itself: undisturbed, and by the wall clock."""
    start, starts = time.perf_counter(), {worker: seconds_of(worker.process.pid) for worker in workers}
    for worker in workers:
        worker.begin(index)
    took: dict[Worker, float] = {}
    while left := [worker for worker in workers if worker not in took]:
        for worker in wait_for(left):
            if isinstance(worker.event(), JobDone):
                took[worker] = seconds_of(worker.process.pid) - starts[worker]
    clock = time.perf_counter() - start
    # With fewer than two processors the workers wait for each other, and this time counts.
    return np.array([max(took.values()) if len(os.sched_getaffinity(0)) >= 2 else clock, clock])


def seconds_of(pid: int | None) -> float:
    """A clock in s that stops while a single-threaded process waits for a processor, if Linux gives this time."""
    try:
        waited = int(Path(f"/proc/{pid}/schedstat").read_text().split()[1])
    except OSError:
        waited = 0
    return time.perf_counter() - 1e-9 * waited


def _serve(connection: Connection, name: str, recipe: Recipe) -> None:
    """The loop of a contender's process: on each message it makes a frame, and sends its undisturbed seconds."""
    connection.recv()
    start = seconds_of(os.getpid())

    def on_frame() -> None:
        nonlocal start
        connection.send(seconds_of(os.getpid()) - start)
        connection.recv()
        start = seconds_of(os.getpid())

    with tempfile.TemporaryDirectory() as folder:
        for index in count():
            render_scene(recipe, index, Path(folder, "scene.h5"), on_frame, RENDERERS[name])
