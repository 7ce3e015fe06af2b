"""Compare explorers on 2D maps by the length of their paths: ``python -m scripts.benchmarks.sieve``."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.stats import bootstrap

from pipeline.arrays import Values
from pipeline.errors import InputError
from sarsim.commands.cli import run, tracked
from sarsim.flags import Given
from scripts.benchmarks.sieve.explorers import EXPLORERS, explore
from scripts.benchmarks.sieve.oracle import GridOracle
from scripts.benchmarks.sieve.world import PAPERS, GridRules, GridScene, GridWorld, draw_scene, read_dungeon

ORACLE = "oracle"
"""Name of the method that knows the map."""


def compare(scenes: Sequence[GridScene], methods: Sequence[str], rules: GridRules = PAPERS) -> dict[str, Values]:
    """For each method, the (N,) lengths of its paths on the maps, pixels; inf where it did not see enough."""
    ways = dict[str, Values]()
    for method in tracked(list(methods), "methods"):
        worlds = [GridWorld(scene, rules) for scene in scenes]
        for number, world in enumerate(worlds):
            if method == ORACLE:
                GridOracle(world.scene, rules).follow(world)
            else:
                explore(world, EXPLORERS[method], np.random.default_rng(number))
        ways[method] = np.array([world.way if world.is_explored else np.inf for world in worlds])
    return ways


def table(ways: dict[str, Values]) -> Table:
    """Mean lengths, and their ratios to the first method's with 95 % intervals, over the maps that both explored."""
    first = next(iter(ways))
    shown = Table("method", "explored", "path, pixels", f"over {first}", "95 % interval")
    for method, way in ways.items():
        done = np.isfinite(way) & np.isfinite(ways[first])
        row = [method, f"{np.isfinite(way).mean():.0%}"]
        if done.sum() > 1:
            pair = way[done], ways[first][done]
            found = bootstrap(pair, _ratio, paired=True, method="percentile", rng=np.random.default_rng(0))
            low, high = found.confidence_interval
            row += [f"{pair[0].mean():.0f}", f"{_ratio(*pair):.3f}", f"{low:.3f} – {high:.3f}"]
        shown.add_row(*row)
    return shown


def _ratio(above: Values, below: Values, axis: int = -1) -> Values:
    return np.asarray(above.sum(axis=axis) / below.sum(axis=axis))


def sieve(methods: tuple[str, ...] = tuple(EXPLORERS), drawn: int = 100, maps: Given[Path] = None) -> None:
    """Explore every map with every method, and print a table.

    Args:
        methods: names of explorers, or oracle, which knows the map; the others are compared with the first.
        drawn: number of maps drawn at random, if there is no folder.
        maps: folder of dungeon maps (.png), such as ARiADNE's.
    """
    for method in methods:
        if method not in {*EXPLORERS, ORACLE}:
            raise InputError(f"--methods {method}: must be {', '.join(EXPLORERS)} or {ORACLE}")
    if maps is not None:
        scenes = [read_dungeon(file) for file in sorted(maps.rglob("*.png"))]
    else:
        scenes = [draw_scene(seed) for seed in range(drawn)]
    if not scenes or not methods:
        raise InputError("there are no maps or no methods; give --maps a folder with .png files, or --drawn a number")
    Console().print(table(compare(scenes, methods)))


if __name__ == "__main__":
    run(sieve)
