"""The arenas of a sweep: names, and splits frozen by checksums."""

import hashlib
from collections.abc import Mapping, Sequence
from functools import cache

import yaml

from pipeline.errors import InputError
from sarsim.assets import asset
from sarsim.commands.cli import check_arena
from sarsim.methods.names import check_method

SPLITS = ("train", "val", "test")
CHECKSUM_DIGITS = 6
"""Number of significant digits with which an arena's numbers enter its checksum."""


def check_names(methods: Sequence[str], arenas: Sequence[str]) -> None:
    """Raise InputError unless all methods and arenas of a sweep exist, without imports that take seconds."""
    if not arenas:
        raise InputError("--arenas: give at least one arena")
    for arena in arenas:
        if arena not in SPLITS:
            check_arena(arena)
    for method in methods:
        check_method("exploration", method, "methods")


def arenas_of(names: Sequence[str]) -> list[str]:
    """The arenas that ``--arenas`` names, without duplicates; a split stands for all its arenas."""
    return list(
        dict.fromkeys(arena for name in names for arena in (frozen_checksums(name) if name in SPLITS else [name]))
    )


@cache
def frozen_checksums(split: str) -> Mapping[str, str]:
    """The checksums of a split's arenas, by name."""
    content: Mapping[str, str] = yaml.safe_load(asset("splits", f"{split}.yaml").read_text())
    return content


def checksum(name: str) -> str:
    """SHA-256 of an arena's content, in hexadecimal digits; InputError if there is no such arena."""
    from sarsim.methods.arena import make_arena  # imported here, because checking names must not take seconds

    text: str = make_arena(name).mjcf_model.to_xml_string(precision=CHECKSUM_DIGITS)
    return hashlib.sha256(text.encode()).hexdigest()


def verified_checksum(name: str) -> str:
    """The checksum of an arena.

    Raises:
        InputError: the arena does not exist, or it belongs to a split and has changed since the split was frozen.
    """
    found = checksum(name)
    for split in SPLITS:
        if frozen_checksums(split).get(name, found) != found:
            raise InputError(
                f"{name}: its checksum differs from that in {split}.yaml, so its results cannot be compared"
            )
    return found
