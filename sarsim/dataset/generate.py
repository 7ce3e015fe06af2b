"""Generation of a dataset, or of its missing scenes."""

import logging
from collections.abc import Callable
from contextlib import closing, suppress
from functools import partial
from pathlib import Path

from pipeline.files import make_folder
from sarsim.dataset.croissant import describe_dataset
from sarsim.dataset.manifest import MANIFEST_FILE, SCENES_FOLDER, Manifest, sha256_of
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.render import PLUGIN_HOOKS, make_scene
from sarsim.dataset.summary import write_summary
from sarsim.jobs import Engine, locked
from sarsim.methods.plugins import make_plugins

_log = logging.getLogger(__name__)


def generate(
    recipe: Recipe, scenes: int, folder: Path, engine: Engine, on_frames: Callable[[int], object] = lambda count: None
) -> Manifest:
    """Make the first ``scenes`` scenes of a recipe, except those that are already complete.

    Write dataset.json, the scenes' files, index.html and croissant.json, and return the content of dataset.json.
    ``on_frames`` is called with the number of frames in complete scenes, at the start and after every scene.

    Raises:
        InputError: a scene cannot be made, or the folder cannot be written or holds other files.
    """
    make_folder(folder, [MANIFEST_FILE])
    manifest = Manifest.new(recipe)
    with locked(folder) as lock:
        # keep the scenes that are complete, if the folder holds the same dataset
        if (folder / MANIFEST_FILE).exists():
            earlier = Manifest.read(folder)
            earlier.check_same(manifest, folder)
            for index, entry in earlier.scenes.items():
                path = folder / entry.file
                if path.is_file() and sha256_of(path) == entry.sha256:
                    manifest.scenes[index] = entry
                else:
                    _log.warning("%s: missing or changed; generating it again", path)
        manifest.write(folder)
        on_frames(len(manifest.scenes) * recipe.frames)
        # make the others
        todo = [index for index in range(scenes) if index not in manifest.scenes]
        try:
            with closing(engine(partial(make_scene, recipe), todo, lock)) as outcomes:
                for index, entry, error in outcomes:
                    if error is not None:
                        raise type(error)(f"scene {index}: {error}") from error
                    manifest.scenes[index] = entry
                    manifest.write(folder)
                    on_frames(len(manifest.scenes) * recipe.frames)
        finally:
            for unfinished in (folder / SCENES_FOLDER).glob("*.part"):
                with suppress(OSError):
                    unfinished.unlink()
        splits = {index: entry.split for index, entry in sorted(manifest.scenes.items())}
        for plugin in make_plugins(recipe, PLUGIN_HOOKS):
            plugin.dataset(folder, splits)
        write_summary(folder)
        describe_dataset(folder, manifest)
        return manifest
