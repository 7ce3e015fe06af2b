"""Names of arenas, checked without importing the simulator, so that a wrong name is refused at once."""

from pathlib import Path

from pipeline.errors import InputError
from pipeline.files import check_regular

BUILT_IN = ("nist_6x4", "esogu_52x15")
RANDOM = "random:"
MAX_DIGITS = 18  # Maximum number of digits of a seed
BUILT_EXTENSIONS = (".raf", ".sdf", ".world", ".model", ".yaml")
"""Extensions of the files from which an arena is built."""
MJCF_EXTENSION = ".xml"


def check_arena_name(name: str) -> None:
    """Raise InputError unless ``name`` is a built-in arena, ``random:SEED`` or the path of a file of a known type."""
    if name in BUILT_IN:
        return
    if name.startswith(RANDOM):
        seed_of(name)
    elif Path(name).suffix.lower() in (*BUILT_EXTENSIONS, MJCF_EXTENSION):
        check_regular(Path(name))
    else:
        raise InputError(
            f"unknown arena {name!r}: use {', '.join(BUILT_IN)}, {RANDOM}SEED, a plug-in's or a file"
            f" with one of these extensions: {', '.join((*BUILT_EXTENSIONS, MJCF_EXTENSION))}"
        )


def seed_of(name: str) -> int:
    """The seed in ``random:SEED``; InputError if the seed is invalid."""
    text = name.removeprefix(RANDOM)
    if not text.isdecimal() or len(text) > MAX_DIGITS:
        raise InputError(f"arena {name!r}: the seed must be a non-negative integer of at most {MAX_DIGITS} digits")
    return int(text)
