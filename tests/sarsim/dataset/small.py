"""Small datasets to test with."""

from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from pipeline.errors import InputError
from pipeline.frame import Frame, Intrinsics
from sarsim.dataset.generate import generate
from sarsim.dataset.manifest import SceneEntry, scene_path, sha256_of, split_of
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.scene_file import NO_BOX, SceneContent, SceneFrame, SceneWriter
from sarsim.jobs import FolderLock

RECIPE = Recipe(seed=3, frames=3, width=64, height=48, arenas=("nist_6x4",))
"""Makes a scene in some tenths of a second."""
TOYS = 3
"""Scenes of a toy dataset."""


def content(victims: int = 2) -> SceneContent:
    """A scene of four geoms, the last two of which are the first victim's."""
    return SceneContent(
        settings={"arena": "toy", "lighting": "dim", "dust": 0.0},
        mjcf="<mujoco model='tøy'/>",
        intrinsics=Intrinsics(8, 6, 7.0, 7.5, 4.25, 3.0),
        geom_name=["floor", "wall", "arm", "leg"],
        geom_label=np.array([2, 1, 6, 6], np.uint8),
        geom_victim=np.array([-1, -1, 0, 0] if victims else [-1] * 4, np.int16),
        geom_object=np.array([0, 1, 2, 2] if victims else range(4), np.int16),
        victim_id=[f"v{k}" for k in range(victims)],
        victim_pose=np.array([np.eye(4) * (k + 1) for k in range(victims)]).reshape(-1, 4, 4),
        victim_box=np.arange(6.0 * victims).reshape(-1, 2, 3),
    )


def frame(index: int, victims: int = 2) -> SceneFrame:
    """Some frame."""
    rng = np.random.default_rng(index)
    depth = rng.uniform(0.8, 3.5, (6, 8)).astype(np.float32)
    depth[0, :index] = 0
    instance = rng.integers(0, 4, (6, 8)).astype(np.int32)
    pose = np.eye(4)
    pose[:3, 3] = index, 2, 0.5
    odom = pose.copy()
    odom[0, 3] += 0.1
    boxes = np.full((victims, 4), NO_BOX, np.int32)
    area = np.zeros(victims, np.int32)
    if victims:
        boxes[0], area[0] = (1, 2, 5, 6), 120
    image = Frame(
        time=0.2 * index,
        rgb=rng.integers(0, 256, (6, 8, 3), dtype=np.uint8),
        depth=depth,
        intrinsics=content().intrinsics,
        T_base_camera=np.array([[0, 0, 1, 0.2], [-1, 0, 0, 0], [0, -1, 0, 0.6], [0, 0, 0, 1]], np.float64),
        T_odom_base=odom,
        label=content().geom_label[instance],
        instance=instance,
    )
    return SceneFrame(image, pose, boxes, area)


def write_scene(path: Path, frames: int = 3, victims: int = 2) -> None:
    """A scene's file."""
    with SceneWriter(path, frames, content(victims)) as writer:
        for index in range(frames):
            writer.write(frame(index, victims))


class InProcess:
    """An engine without processes, which makes real scenes or writes toy ones."""

    def __init__(self, toys: bool = False):
        self.toys = toys
        self.made: list[Any] = []

    def __call__(
        self, work: Callable[[Any, Path], Any], jobs: Iterable[Any], lock: FolderLock
    ) -> Generator[tuple[Any, Any, Exception | None]]:
        for job in jobs:
            self.made.append(job)
            try:
                yield job, toy(job, lock.folder) if self.toys else work(job, lock.folder), None
            except InputError as error:
                yield job, None, error


def toy(index: int, folder: Path) -> SceneEntry:
    """A scene that is made at once."""
    path = folder / scene_path(index)
    path.parent.mkdir(exist_ok=True)
    write_scene(path)
    points = {"wall": 5, "terrain": 7 + index}
    return SceneEntry(index, scene_path(index), split_of(index), sha256_of(path), 3, "toy", "dim", points)


def toys(folder: Path, scenes: int = TOYS, recipe: Recipe = RECIPE) -> list[int]:
    """Generate toy scenes without a page that shows them; returns which were made."""
    engine = InProcess(toys=True)
    with patch("sarsim.dataset.generate.write_summary"):
        generate(recipe, scenes, folder, engine)
    return engine.made


def files(folder: Path) -> dict[str, bytes]:
    """Contents by path, without the settings that the command leaves."""
    found = (path for path in folder.rglob("*") if path.is_file() and path.name != "config.yaml")
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(found)}
