"""Makes a dataset, or those of its scenes that are still missing."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pipeline.files import make_folder
from sarsim.dataset.engine import Engine, FrameDone, SceneDone, SceneLost
from sarsim.dataset.folder_lock import FolderLock
from sarsim.dataset.manifest import FILE, SCENES, Manifest, sha256_of
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.summary import write_summary

_log = logging.getLogger(__name__)


def generate(
    recipe: Recipe, scenes: int, folder: Path, engine: Engine, on_frames: Callable[[int], object] = lambda count: None
) -> Manifest:
    """Make the first ``scenes`` scenes of a recipe; those that are already complete are kept.

    The folder gets dataset.json, which is returned, the scenes' files and index.html. ``on_frames`` is called often,
    with the number of frames made so far.

    Raises:
        InputError: the recipe cannot be followed, the folder cannot be written, or it holds other files.
    """
    make_folder(folder, [FILE])
    with _locked(folder) as lock:
        manifest = _begun(recipe, folder)
        manifest.write(folder)
        (folder / SCENES).mkdir(exist_ok=True)
        made = dict.fromkeys(manifest.scenes, recipe.frames)
        on_frames(sum(made.values()))
        for event in engine.render(recipe, [k for k in range(scenes) if k not in made], folder, lock):
            if isinstance(event, FrameDone):
                made[event.index] = made.get(event.index, 0) + 1
            elif isinstance(event, SceneLost):
                _log.warning("scene %d: its worker died; it begins again", event.index)
                made[event.index] = 0
            elif isinstance(event, SceneDone):
                manifest.scenes[event.entry.index] = event.entry
                manifest.write(folder)
            on_frames(sum(made.values()))
        write_summary(folder)
        return manifest


@contextmanager
def _locked(folder: Path) -> Iterator[FolderLock]:
    """Lock the folder, and in the end delete half-written files in it."""
    with FolderLock.take(folder) as lock:
        try:
            yield lock
        finally:
            for partial in (folder / SCENES).glob("*.part"):
                with suppress(OSError):
                    partial.unlink()


def _begun(recipe: Recipe, folder: Path) -> Manifest:
    """The complete scenes of the dataset; InputError if the folder holds another dataset."""
    new = Manifest.new(recipe)
    if not (folder / FILE).exists():
        return new
    manifest = Manifest.read(folder)
    manifest.check_same(new, folder)
    for index, entry in list(manifest.scenes.items()):
        path = folder / entry.file
        if not path.is_file() or sha256_of(path) != entry.sha256:
            _log.warning("%s: missing or changed; it is made again", path)
            del manifest.scenes[index]
    return manifest
