"""Generate a labelled RGB-D dataset in random rescue arenas."""

import sys
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Literal

from rich.console import Console

from pipeline.errors import InputError
from pipeline.files import check_folder
from sarsim.arenas.names import check_arena_name
from sarsim.commands.cli import progress
from sarsim.commands.settings import run_with_settings, save_settings
from sarsim.dataset.settings import RANDOM, DatasetConfig, HarderDatasetConfig, check_range
from sarsim.flags import Given
from sarsim.jobs import make_engine
from sarsim.opengl import check_rendering, without_opengl


@dataclass(frozen=True, kw_only=True)
class GenerateDatasetConfig(DatasetConfig):
    """Settings of a dataset, and of the processes that generate it.

    Attributes:
        out: folder for the dataset. An incomplete dataset in it is completed.
        scenes: number of scenes; a network trained on more scenes does better in arenas that it has not seen.
        workers: number of processes. By default one per core; the dataset does not depend on it.
        engine: run processes on this machine (local), or tasks on the Ray cluster at RAY_ADDRESS (ray; on this
            machine if RAY_ADDRESS is not set).
        harder: use the defaults of the harder mix: obstacles and ceilings among the ramps, dim light and darkness,
            dust, and some scenes without the sensor's noise. Other flags still override them.
    """

    out: Path
    scenes: int = 10
    workers: Given[int] = None
    engine: Literal["local", "ray"] = "local"
    harder: bool = False


@dataclass(frozen=True, kw_only=True)
class GenerateHarderDatasetConfig(HarderDatasetConfig, GenerateDatasetConfig):
    """Settings as in :class:`GenerateDatasetConfig`, with the defaults of the harder mix."""


def generate_dataset(settings: GenerateDatasetConfig) -> None:
    """Generate a dataset, or the missing part of one, and print its folder."""
    if settings.harder and not isinstance(settings, GenerateHarderDatasetConfig):
        raise InputError("--config: a file must not set harder; give --harder as a flag")
    check_range("scenes", settings.scenes, 1)
    if settings.workers is not None:
        check_range("workers", settings.workers, 1)
    for arena in {*settings.arenas} - {RANDOM}:
        check_arena_name(arena)
    with without_opengl():
        from sarsim.arenas.load import load_arena
        from sarsim.dataset.generate import generate
        from sarsim.dataset.manifest import MANIFEST_FILE
        from sarsim.dataset.recipe import Recipe
        from sarsim.dataset.render import PLUGIN_HOOKS
        from sarsim.methods.plugins import make_plugins

    if settings.engine == "local":
        check_rendering()
    make_plugins(settings, PLUGIN_HOOKS)
    check_folder(settings.out, [MANIFEST_FILE])
    for arena in {*settings.arenas} - {RANDOM}:
        load_arena(arena)
    recipe = Recipe(**{f.name: getattr(settings, f.name) for f in fields(DatasetConfig)})
    with progress() as bars:
        bar = bars.add_task("frames", total=settings.scenes * settings.frames)
        engine = make_engine(settings.engine, settings.workers)
        manifest = generate(
            recipe, settings.scenes, settings.out, engine, lambda made: bars.update(bar, completed=made)
        )
    save_settings(replace(settings, harder=False), settings.out / "config.yaml")
    count = f"{len(manifest.scenes)} scene{'s' * (len(manifest.scenes) != 1)}"
    text = f"{count} in {settings.out}; for an overview, open {settings.out / 'index.html'}"
    Console(markup=False).print(text, soft_wrap=True)


def main() -> None:
    """Entry point of ``sarsim-dataset``."""
    run_with_settings(
        generate_dataset, GenerateHarderDatasetConfig if "--harder" in sys.argv[1:] else GenerateDatasetConfig
    )
