"""The dataset generator compared with a generator that uses ``mujoco.Renderer``, and two workers compared with one.

The generators make the same complete scenes: arena, drive, sensor errors and file. They take turns frame by frame.
Each generator and each worker has one thread; the times exclude waits for a processor that other programs use, but
include waits for a disk or a graphics card.
"""

import tempfile
import time
from collections.abc import Sequence
from itertools import count
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.processes import usable_cores
from sarsim.commands.cli import tracked
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.render import make_scene, render_scene
from sarsim.jobs import start_worker
from scripts.benchmarks.common import RENDERERS, Result, check_at_least
from scripts.benchmarks.settings import DatasetSettings


def measure(settings: DatasetSettings) -> Result:
    """Times of each contender, and the speed-ups of our generator and of two workers.

    Each contender first makes one scene that is not timed.

    Raises:
        InputError: a number is below 1.
    """
    check_at_least(1, settings, "scenes", "rounds")
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
    """Seconds of every frame, by contender; the first frame of a scene includes the time for arena and drive."""
    contenders = {name: start_worker(_serve, name, recipe) for name in RENDERERS}
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
    """(rounds, 2) ratio of two workers' throughput to one worker's, in undisturbed time and in wall-clock time."""
    with tempfile.TemporaryDirectory() as name:
        folders = [Path(name, part) for part in "ab"]
        for folder in folders:
            folder.mkdir()
        workers = [start_worker(make_scenes, recipe, folder) for folder in folders]
        both = [connection for _, connection in workers]
        alone = both[:1]
        _make(both, 0)
        numbers = tracked(range(1, rounds + 1), "rounds")
        ratios = [2 * _make(alone, index) / _make(both, index) for index in numbers]
        for process, _ in workers:
            process.kill()
            process.join()
    return np.array(ratios)


def _make(workers: Sequence[Connection], index: int) -> NDArray[np.float64]:
    """(2,) seconds until every worker has made the same scene in its own folder: undisturbed and wall-clock time."""
    start = time.perf_counter()
    for worker in workers:
        worker.send(index)
    took = max(worker.recv() for worker in workers)
    clock = time.perf_counter() - start
    # With fewer than two processors, the workers wait for each other, and this time must be included.
    return np.array([took if usable_cores() >= 2 else clock, clock])


def make_scenes(connection: Connection, recipe: Recipe, folder: Path) -> None:
    """The loop of a worker: receive a scene's index, make the scene, and send the undisturbed seconds."""
    while True:
        index = connection.recv()
        start = undisturbed_seconds()
        make_scene(recipe, index, folder)
        connection.send(undisturbed_seconds() - start)


def undisturbed_seconds() -> float:
    """Time, s, on a clock that stops while this single-threaded process waits for a processor, as Linux reports."""
    try:
        waited = int(Path("/proc/self/schedstat").read_text().split()[1])
    except OSError:
        waited = 0
    return time.perf_counter() - 1e-9 * waited


def _serve(connection: Connection, name: str, recipe: Recipe) -> None:
    """The loop of a contender's process: on each message, make a frame and send its undisturbed seconds."""
    connection.recv()
    start = undisturbed_seconds()

    def on_frame() -> None:
        nonlocal start
        connection.send(undisturbed_seconds() - start)
        connection.recv()
        start = undisturbed_seconds()

    with tempfile.TemporaryDirectory() as folder:
        for index in count():
            render_scene(recipe, index, Path(folder, "scene.h5"), on_frame, RENDERERS[name])
