"""What a worker does for one scene, wherever it runs."""

from collections.abc import Callable
from pathlib import Path

from pipeline.files import whole_file
from pipeline.labels import Label
from sarsim.dataset.manifest import SceneEntry, scene_path, sha256_of, split_of
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.render import render_scene


def make_scene(recipe: Recipe, index: int, folder: Path, on_frame: Callable[[], object] = lambda: None) -> SceneEntry:
    """Make a scene's file, whole or not at all.

    Raises:
        InputError: the arena cannot be had, or the file cannot be written.
    """
    path = folder / scene_path(index)
    with whole_file(path) as partial:
        scene, points = render_scene(recipe, index, partial, on_frame)
        digest = sha256_of(partial)
    return SceneEntry(
        index=index,
        file=scene_path(index),
        split=split_of(index),
        sha256=digest,
        frames=recipe.frames,
        arena=scene.arena,
        lighting=scene.conditions.lighting.name,
        points={label.name.lower(): int(points[label]) for label in Label},
    )
