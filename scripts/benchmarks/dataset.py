"""The dataset generator against one that draws with ``mujoco.Renderer``'s three passes, and two workers against one.

Both generators make the same scenes from beginning to end, arena, drive, sensor's errors and file included; they take
turns frame by frame. Each generator and each worker is one thread; the seconds in which other programs keep it from a
processor do not count, those in which it waits for a disk or a graphics card do.
"""

import os
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import count
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import ClassVar

import mujoco
import numpy as np
from numpy.typing import NDArray
from rich.progress import track

from pipeline.errors import InputError
from sarsim.dataset import processes
from sarsim.dataset.engine import SceneDone
from sarsim.dataset.folder_lock import FolderLock
from sarsim.dataset.local_engine import Worker, wait_for
from sarsim.dataset.manifest import SCENES
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.render import render_scene
from sarsim.scripts.benchmarks.subject import Result, Subject
from sarsim.sensors.rendering import COLOUR_QUALITY, Renderer


@dataclass(frozen=True)
class Dataset(Subject):
    """Frames per second of the dataset generator."""

    scenes: int = 4
    """How many arenas each contender makes, after one that is not counted."""
    frames: int = 100
    """Looks a scene."""
    rounds: int = 5
    """How often one worker and two make a scene each."""
    seed: int = 0
    """Of the arenas."""

    def measure(self) -> Result:
        """How many times faster.

        Raises:
            InputError: there is nothing to make.
        """
        if min(self.scenes, self.rounds) < 1:
            raise InputError("--scenes and --rounds: give at least 1")
        recipe = Recipe(seed=self.seed, frames=self.frames)
        seconds = {name: np.array(times) for name, times in self._contest(recipe).items()}
        figures = {
            f"frames_vs_{name}": float(times.sum() / seconds["ours"].sum())
            for name, times in seconds.items()
            if name != "ours"
        }
        undisturbed, clock = np.median(self._scaling(recipe), axis=0).tolist()
        figures |= {"two_workers_vs_one": undisturbed, "two_workers_vs_one.by_the_clock": clock}
        for name, times in seconds.items():
            figures[f"{name}.frames_per_s"] = float(times.size / times.sum())
            figures[f"{name}.frame_ms"] = float(1e3 * np.median(times))
        return Result(figures)

    def _contest(self, recipe: Recipe) -> dict[str, list[float]]:
        """Seconds of every frame; the first one of a scene includes its arena and drive."""
        contenders = {name: Contender(name, recipe) for name in RENDERERS}
        seconds: dict[str, list[float]] = {name: [] for name in RENDERERS}
        for frame in track(range((1 + self.scenes) * recipe.frames), "frames", transient=True):
            for name, contender in contenders.items():
                elapsed = contender.frame()
                if frame >= recipe.frames:
                    seconds[name].append(elapsed)
        for contender in contenders.values():
            contender.end()
        return seconds

    def _scaling(self, recipe: Recipe) -> NDArray[np.float64]:
        """(rounds, 2) how many times as much two workers do as one: undisturbed, and by the clock on the wall."""
        with tempfile.TemporaryDirectory() as name:
            folders = [Path(name, part) for part in "ab"]
            for folder in folders:
                (folder / SCENES).mkdir(parents=True)
            with FolderLock.take(folders[0]) as lock:
                workers = [Worker(recipe, folder, lock) for folder in folders]
                _make(workers, 0)
                rounds = track(range(1, self.rounds + 1), "rounds", transient=True)
                ratios = [2 * _make(workers[:1], index) / _make(workers, index) for index in rounds]
                for worker in workers:
                    worker.end()
        return np.array(ratios)


def _make(workers: Sequence[Worker], index: int) -> NDArray[np.float64]:
    """(2,) seconds in which all of them make the same scene, each for itself: undisturbed, and by the clock."""
    start, starts = time.perf_counter(), {worker: seconds_of(worker.process.pid) for worker in workers}
    for worker in workers:
        worker.begin(index)
    took: dict[Worker, float] = {}
    while left := [worker for worker in workers if worker not in took]:
        for worker in wait_for(left):
            if isinstance(worker.event(), SceneDone):
                took[worker] = seconds_of(worker.process.pid) - starts[worker]
    clock = time.perf_counter() - start
    # Where there are not so many processors they keep each other waiting, and that does count.
    return np.array([max(took.values()) if len(os.sched_getaffinity(0)) >= 2 else clock, clock])


def seconds_of(pid: int | None) -> float:
    """A clock that stands still while a process of one thread waits for a processor, as far as Linux tells."""
    try:
        waited = int(Path(f"/proc/{pid}/schedstat").read_text().split()[1])
    except OSError:
        waited = 0
    return time.perf_counter() - 1e-9 * waited


class Contender:
    """A process that makes scene after scene, a frame at a time."""

    def __init__(self, name: str, recipe: Recipe):
        """``name``: of a renderer."""
        self._connection, theirs = Pipe()
        self._process = processes.start(_serve, name, theirs, recipe)
        theirs.close()

    def frame(self) -> float:
        """Undisturbed seconds that the next frame took."""
        self._connection.send(None)
        return self._connection.recv()

    def end(self) -> None:
        """Stop it."""
        self._process.kill()
        self._process.join()


def _serve(name: str, connection: Connection, recipe: Recipe) -> None:
    """What a contender's process does."""
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


class ThreePasses(Renderer):
    """``mujoco.Renderer``: colour, depth and segmentation one after the other, at MuJoCo's default quality."""

    QUALITY: ClassVar[dict[str, int]] = {}

    def __init__(self, model: mujoco.MjModel, width: int, height: int):
        ExitStack.__init__(self)
        self.model, self.width, self.height = model, width, height
        default = mujoco.MjSpec().visual.quality
        for name in ("offsamples", "shadowsize", "numslices", "numstacks", "numquads"):
            setattr(model.vis.quality, name, self.QUALITY.get(name, getattr(default, name)))
        # A larger framebuffer, as these arenas have for people to look at, would only cost it time.
        model.vis.global_.offwidth, model.vis.global_.offheight = width, height
        self._renderer = self.enter_context(mujoco.Renderer(model, height, width))

    def colour(self, data: mujoco.MjData, camera: int | str | mujoco.MjvCamera) -> NDArray[np.uint8]:
        """(H, W, 3) uint8 RGB."""
        return self._picture(data, camera).copy()

    def segmentation_and_depth(
        self, data: mujoco.MjData, camera: int | str | mujoco.MjvCamera
    ) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """(H, W) int32 geom ids, -1 where there is none, and (H, W) float32 m."""
        self._renderer.enable_depth_rendering()
        depth = self._picture(data, camera).copy()
        self._renderer.enable_segmentation_rendering()
        ids = self._picture(data, camera)
        self._renderer.disable_segmentation_rendering()
        return np.where(ids[..., 1] == int(mujoco.mjtObj.mjOBJ_GEOM), ids[..., 0], -1), depth

    def _picture(self, data: mujoco.MjData, camera: int | str | mujoco.MjvCamera) -> NDArray:
        self._renderer.update_scene(data, camera)
        return self._renderer.render()


class ThreePassesAtOurQuality(ThreePasses):
    """The same with the quality of our own colour picture."""

    QUALITY = COLOUR_QUALITY


RENDERERS: dict[str, type[Renderer]] = {
    "ours": Renderer,
    "renderer": ThreePasses,
    "renderer_at_our_quality": ThreePassesAtOurQuality,
}
