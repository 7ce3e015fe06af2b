"""The arenas of a sweep: names, splits frozen by checksums, and 2D maps."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

import yaml

from pipeline.errors import InputError
from sarsim.arenas.load import load_arena
from sarsim.assets import asset
from sarsim.commands.sweeps.names import GRID
from sarsim.tasks.grid_scenes import DRAWINGS, SIZES, GridScene, draw_scene, dungeon_files, read_dungeon

MAPS, ARENAS = 100, 12
"""Numbers of 2D maps and of arenas in a split."""
SIGNIFICANT = 6
"""Significant digits of an arena's numbers that enter its checksum."""


def arenas_of(names: Sequence[str]) -> list[str]:
    """The arenas that ``--arenas`` names, without duplicates; a split or a folder of maps stands for all its arenas.

    Raises:
        InputError: there are no arenas, a folder has no maps, or 2D maps are mixed with MuJoCo arenas.
    """
    found = list(dict.fromkeys(arena for name in names for arena in _expanded(name)))
    if not found:
        raise InputError("--arenas: give at least one arena")
    if len({name.startswith(GRID) for name in found}) != 1:
        raise InputError(
            f"--arenas {' '.join(names)}: 2D maps ({GRID}…) and MuJoCo arenas cannot be mixed; run two sweeps"
        )
    return found


def _expanded(name: str) -> Iterator[str]:
    path = Path(name.removeprefix(GRID))
    if name in DRAWINGS:
        yield from frozen(name)["mujoco"]
    elif name.startswith(GRID) and name.removeprefix(GRID) in DRAWINGS:
        yield from frozen(name.removeprefix(GRID))["grid"]
    elif name.startswith(GRID) and path.is_dir():
        yield from (f"{GRID}{file}" for file in dungeon_files(path))
    else:
        yield name


@cache
def frozen(split: str) -> Mapping[str, Mapping[str, str]]:
    """The arenas of a split with their checksums, under ``mujoco`` and ``grid``."""
    content: Mapping[str, Mapping[str, str]] = yaml.safe_load(asset("splits", f"{split}.yaml").read_text())
    return content


def grid_scene(name: str) -> GridScene:
    """The 2D map with this name; InputError if there is none."""
    rest = name.removeprefix(GRID)
    split, _, number = rest.partition(":")
    if split in DRAWINGS and number.isdecimal() and int(number) < DRAWINGS["val"]:
        return draw_scene(DRAWINGS[split] + int(number), *SIZES["papers"])
    return read_dungeon(Path(rest))


def checksum(name: str) -> str:
    """SHA-256 of an arena's content, in hexadecimal digits; InputError if there is no such arena."""
    if name.startswith(GRID):
        scene = grid_scene(name)
        return hashlib.sha256(f"{scene.free.shape} {scene.start}".encode() + scene.free.tobytes()).hexdigest()
    text: str = load_arena(name).mjcf_model.to_xml_string(precision=SIGNIFICANT)
    return hashlib.sha256(text.encode()).hexdigest()


def checked(name: str) -> str:
    """The checksum of an arena.

    Raises:
        InputError: the arena does not exist, or it belongs to a split and has changed since the split was frozen.
    """
    found = checksum(name)
    for split in DRAWINGS:
        for tier in frozen(split).values():
            if tier.get(name, found) != found:
                raise InputError(
                    f"{name}: its checksum differs from that in {split}.yaml, so its results cannot be compared"
                )
    return found
