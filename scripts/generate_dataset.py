"""Generate a labelled RGB-D dataset in random rescue arenas."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.console import Console
from rich.progress import MofNCompleteColumn, Progress, TimeElapsedColumn

from pipeline.errors import InputError
from sarsim.dataset.engine import Engine
from sarsim.dataset.generate import generate
from sarsim.dataset.local_engine import LocalEngine
from sarsim.dataset.recipe import Recipe
from sarsim.scripts.cli import run


@dataclass(frozen=True)
class GenerateConfig:
    """What is generated, and how.

    Attributes:
        out: folder for the dataset; one that holds a part of it is completed.
        scenes: how many arenas.
        recipe: of the scenes.
        workers: processes at a time, one a core if not given; the dataset does not depend on it.
        engine: processes on this machine, or tasks on a Ray cluster.
        ray_address: of a running cluster, if not given one is started on this machine.
    """

    out: Path
    scenes: int = 10
    recipe: Annotated[Recipe, tyro.conf.arg(name="")] = field(default_factory=Recipe)
    workers: int | None = None
    engine: Literal["local", "ray"] = "local"
    ray_address: str | None = None


def generate_dataset(config: Annotated[GenerateConfig, tyro.conf.arg(name="")]) -> None:
    """Generate the dataset, or what is missing of it, and say where it lies."""
    if config.scenes < 1 or (config.workers is not None and config.workers < 1):
        raise InputError("--scenes, --workers: at least 1")
    console = Console(stderr=True)
    columns = (*Progress.get_default_columns(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as progress:
        bar = progress.add_task("frames", total=config.scenes * config.recipe.frames)
        manifest = generate(
            config.recipe,
            config.scenes,
            config.out,
            make_engine(config),
            lambda made: progress.update(bar, completed=made),
        )
    Console().print(
        f"{len(manifest.scenes)} scenes in {config.out}; look at them in {config.out / 'index.html'}",
        soft_wrap=True,
    )


def make_engine(config: GenerateConfig) -> Engine:
    """The engine that the flags name.

    Raises:
        InputError: it is not installed.
    """
    workers = config.workers or len(os.sched_getaffinity(0))
    if config.engine == "ray":
        from sarsim.dataset.ray_engine import RayEngine

        return RayEngine(workers, config.ray_address)
    return LocalEngine(workers)


def main() -> None:
    """Entry point."""
    run(generate_dataset)


if __name__ == "__main__":
    main()
