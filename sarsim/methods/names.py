"""Names of methods: checked without loading any method, so that a wrong name is rejected at once, and loaded.

A name of the user's own is MODULE:CLASS (for an arena, MODULE:FUNCTION), looked up on PYTHONPATH and in the working
directory, or an entry point that an installed package registers in the group ``sarsim.<flag>``.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import EntryPoints, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pipeline.errors import InputError
from sarsim.settings import METHODS

OWN_CLASS, OWN_FUNCTION = "MODULE:CLASS", "MODULE:FUNCTION"


def check_method(kind: str, name: str, flag: str = "") -> None:
    """Check that a name is that of a shipped method or an entry point, or begins with an existing module.

    Args:
        kind: a key of ``METHODS``.
        name: name of the method.
        flag: the flag that names the method, for error messages, if it differs from ``kind``.

    Raises:
        InputError: there is no such method; the message lists those that exist.
    """
    module, colon, _ = name.partition(":")
    if colon:
        top, _, _ = module.partition(".")
        if not top:
            raise InputError(f"--{flag or kind} {name}: must name a module before the colon")
        with working_folder():
            is_there = find_spec(top) is not None
        if not is_there:
            raise InputError(f"--{flag or kind} {name}: no module {top!r} on PYTHONPATH or in the working directory")
    elif name not in METHODS[kind]:
        own_method(kind, name, flag=flag)


def own_method(kind: str, name: str, form: str = OWN_CLASS, flag: str = "") -> EntryPoints:
    """The entry points with a given name; InputError, listing the existing names, if there is none."""
    group = f"sarsim.{kind.replace('-', '_')}"
    if not (found := entry_points(group=group, name=name)):
        known = ", ".join([*METHODS[kind], *sorted(entry_points(group=group).names)])
        raise InputError(f"--{flag or kind} {name or repr(name)}: must be {known}{' or ' if known else ''}{form}")
    return found


def load_own(kind: str, name: str, form: str) -> Any:
    """The object that a name of the user's own stands for; an error in its module keeps its traceback.

    Raises:
        InputError: there is no such module, or it does not define the object.
    """
    module, colon, attribute = name.partition(":")
    with working_folder():
        if not colon:
            return next(iter(own_method(kind, name, form))).load()
        try:
            return getattr(import_module(module), attribute)
        except ModuleNotFoundError as error:
            if not f"{module}.".startswith(f"{error.name}."):
                raise
            raise InputError(f"--{kind} {name}: {error}") from None
        except AttributeError as error:
            if error.name != attribute:
                raise
            raise InputError(f"--{kind} {name}: {error}") from None


@contextmanager
def working_folder() -> Iterator[None]:
    """Also search for modules in the working directory, after all other locations."""
    sys.path.append(str(Path.cwd()))
    try:
        yield
    finally:
        sys.path.pop()
