"""Makes a dataset, or those of its scenes that are still missing."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

from pipeline.files import make_folder
from sarsim.dataset.croissant import describe_dataset
from sarsim.dataset.engine import Engine, JobDone, JobFailed, JobLost, PartDone
from sarsim.dataset.folder_lock import FolderLock
from sarsim.dataset.manifest import FILE, SCENES, Manifest, SceneEntry, sha256_of
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.render import make_scene
from sarsim.dataset.summary import write_summary

_log = logging.getLogger(__name__)


def generate(
    recipe: Recipe, scenes: int, folder: Path, engine: Engine, on_frames: Callable[[int], object] = lambda count: None
) -> Manifest:
    """Make the first ``scenes`` scenes of a recipe; those that are already complete are kept.

    The folder gets dataset.json, which is returned, the scenes' files, index.html and croissant.json.
    ``on_frames`` is called often, with the number of frames made so far.

    Raises:
        InputError: the recipe cannot be followed, the folder cannot be written, or it holds other files.
    """
    make_folder(folder, [FILE])
    with _locked(folder) as lock:
        manifest = _begun(recipe, folder)
        manifest.write(folder)
        made = dict.fromkeys(manifest.scenes, recipe.frames)
        on_frames(sum(made.values()))
        todo = [index for index in range(scenes) if index not in made]
        for event in engine.run(partial(make_scene, recipe), todo, folder, lock):
            if isinstance(event, PartDone):
                made[event.index] = made.get(event.index, 0) + 1
            elif isinstance(event, JobLost):
                _log.warning("scene %d: its worker died; it begins again", event.index)
                made[event.index] = 0
            elif isinstance(event, JobFailed):
                raise type(event.error)(f"scene {event.index}: {event.error}") from event.error
            elif isinstance(event, JobDone):
                entry = event.product
                assert isinstance(entry, SceneEntry)
                made[entry.index] = recipe.frames
                manifest.scenes[entry.index] = entry
                manifest.write(folder)
            on_frames(sum(made.values()))
        write_summary(folder)
        describe_dataset(folder, manifest)
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
