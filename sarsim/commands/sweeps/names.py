"""Checks of the names of a sweep's methods and arenas, before imports that take seconds."""

from collections.abc import Sequence
from pathlib import Path

from pipeline.errors import InputError
from sarsim.arenas.names import check_arena_name
from sarsim.assets import asset
from sarsim.methods.names import check_method

GRID = "grid:"
"""Prefix of the names of 2D maps: ``grid:test:7`` is a randomly generated one, ``grid:FOLDER/7.png`` a file."""
SPLITS = tuple(sorted(file.stem for file in asset("splits").glob("*.yaml")))


def check_sweep(methods: Sequence[str], arenas: Sequence[str]) -> None:
    """Raises InputError unless all methods and arenas of a sweep exist; 2D maps have their own methods."""
    for arena in arenas:
        if arena.startswith(GRID):
            _check_map(arena)
        elif arena not in SPLITS:
            check_arena_name(arena)
    for method in methods:
        check_method("methods" if arenas and arenas[0].startswith(GRID) else "exploration", method, "methods")


def _check_map(name: str) -> None:
    rest = name.removeprefix(GRID)
    split, _, number = rest.partition(":")
    if not ((split in SPLITS and (number.isdecimal() or split == rest)) or Path(rest).exists()):
        known = ", ".join(f"{GRID}{split}" for split in SPLITS)
        raise InputError(f"--arenas {name}: no such 2D maps; use {known}, {GRID}{SPLITS[0]}:NUMBER or {GRID}FOLDER")
