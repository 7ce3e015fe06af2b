"""From the name of an arena to the arena."""

from pathlib import Path

from pipeline.errors import InputError
from sarsim.arenas.arena import RescueArena
from sarsim.assets import asset

BUILT_IN = ("nist_6x4",)


def load_arena(name: str) -> RescueArena:
    """The arena that a command's ``--arena`` names: a built-in one, or the path of an MJCF file.

    Raises:
        InputError: no such arena, or the file is missing, broken or without a start.
    """
    if name in BUILT_IN:
        return RescueArena(asset("arenas", f"{name}.xml"))
    if Path(name).suffix.lower() == ".xml":
        return RescueArena(Path(name))
    raise InputError(
        f"unknown arena {name!r}: give one of {', '.join(BUILT_IN)}, or the path of an MJCF .xml file"
    )
