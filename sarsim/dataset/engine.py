"""The interface of engines, which make the scenes of a dataset independently of each other."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from sarsim.dataset.folder_lock import FolderLock
from sarsim.dataset.manifest import SceneEntry
from sarsim.dataset.recipe import Recipe

ATTEMPTS = 3  # Largest number of attempts at a scene whose workers die


@dataclass(frozen=True)
class FrameDone:
    """A frame of the scene ``index`` is made."""

    index: int


@dataclass(frozen=True)
class SceneDone:
    """A scene's file is complete."""

    entry: SceneEntry


@dataclass(frozen=True)
class SceneLost:
    """A worker died over the scene ``index``, which begins again."""

    index: int


Event = FrameDone | SceneDone | SceneLost


class Engine(Protocol):
    """Makes scenes."""

    def render(self, recipe: Recipe, indices: Sequence[int], folder: Path, lock: FolderLock) -> Iterator[Event]:
        """Make scenes, in any order, and put their files into a dataset's folder; closing the iterator stops this.

        Every process that writes there must hold the ``lock``.

        Raises:
            InputError: a scene cannot be made or written.
        """
        ...
