"""An engine without processes, real or of toys."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from sarsim.dataset.engine import Event, FrameDone, SceneDone
from sarsim.dataset.folder_lock import FolderLock
from sarsim.dataset.generate import generate
from sarsim.dataset.manifest import SceneEntry, scene_path, sha256_of, split_of
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.scene_job import make_scene
from tests.sarsim.dataset.small import RECIPE, write_scene

SCENES = 6


class InProcess:
    """An engine without processes, which makes real scenes or writes toy ones."""

    def __init__(self, toys: bool = False):
        self.toys = toys
        self.made: list[int] = []

    def render(
        self, recipe: Recipe, indices: Sequence[int], folder: Path, lock: FolderLock
    ) -> Iterator[Event]:
        for index in indices:
            self.made.append(index)
            yield FrameDone(index)
            yield SceneDone(toy(index, folder) if self.toys else make_scene(recipe, index, folder))


def toy(index: int, folder: Path) -> SceneEntry:
    """A scene that is made at once."""
    path = folder / scene_path(index)
    write_scene(path)
    points = {"wall": 5, "terrain": 7 + index}
    return SceneEntry(index, scene_path(index), split_of(index), sha256_of(path), 3, "toy", "dim", points)


def toys(folder: Path, scenes: int = SCENES, recipe: Recipe = RECIPE) -> list[int]:
    """Generate toy scenes; returns which were made."""
    engine = InProcess(toys=True)
    generate(recipe, scenes, folder, engine)
    return engine.made


def files(folder: Path) -> dict[str, bytes]:
    """Contents by path."""
    found = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(found)}
