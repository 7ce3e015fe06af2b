"""Checks of the names in a command's settings, before the command's imports, which take seconds."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pipeline.errors import InputError
from sarsim.arenas.names import BUILT_IN, check_arena_name
from sarsim.methods.names import check_method
from sarsim.robots.names import robot_file
from sarsim.settings import METHODS, is_own_arena

READ = ("data", "detector", "init", "map", "path", "weights")
"""Settings that name files or folders to read."""


def check_names(settings: Mapping[str, Any]) -> None:
    """Check the settings that name an arena, a robot, methods, or files to read; others are ignored.

    Raises:
        InputError: one of the names does not exist.
    """
    for name, value in settings.items():
        flag = name.replace("_", "-")
        if flag == "arena" and value not in BUILT_IN:
            if is_own_arena(value):
                check_method(flag, value)
            else:
                check_arena_name(value)
        elif flag == "robot" and value is not None:
            robot_file(value)
        elif flag in METHODS and flag not in ("arena", "arenas", "methods"):
            for method in _each(value, str):
                check_method(flag, method)
        elif flag in READ:
            for path in _each(value, Path):
                if not path.exists():
                    raise InputError(f"{'' if flag == 'path' else f'--{flag} '}{path}: no such file or folder")


def _each(value: Any, kind: type) -> Iterable[Any]:
    """The values of one type in a setting, which holds one value or a tuple."""
    return [one for one in (value if isinstance(value, tuple) else (value,)) if isinstance(one, kind)]
