"""Checks names of methods without loading a method, so that a wrong name is rejected at once, and loads methods.

The name of a user-defined method is MODULE:CLASS, or MODULE:FUNCTION for an arena, and is looked up on PYTHONPATH and
in the working directory. The name may also be an entry point that an installed package registers in the group
``sarsim.<flag>``.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from importlib.metadata import EntryPoints, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pipeline.errors import InputError
from sarsim.settings import METHODS

OWN_CLASS, OWN_FUNCTION = "MODULE:CLASS", "MODULE:FUNCTION"


def check_method(kind: str, name: str, flag: str = "") -> None:
    """Check that ``name`` is a shipped method, an entry point or MODULE:CLASS with an existing module.

    Args:
        kind: a key of ``METHODS``.
        name: name of the method.
        flag: the flag that names the method, for error messages, if it differs from ``kind``.

    Raises:
        InputError: there is no such method; the message lists the existing methods.
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
        find_entry_points(kind, name, flag=flag)


def find_entry_points(kind: str, name: str, form: str = OWN_CLASS, flag: str = "") -> EntryPoints:
    """The entry points with a given name; if there is none, InputError with a list of the existing names."""
    group = f"sarsim.{kind.replace('-', '_')}"
    if not (found := entry_points(group=group, name=name)):
        known = ", ".join([*METHODS[kind], *sorted(entry_points(group=group).names)])
        raise InputError(f"--{flag or kind} {name or repr(name)}: must be {known}{' or ' if known else ''}{form}")
    return found


def load_own(kind: str, name: str, form: str) -> Any:
    """The user-defined class or function with a given name; an error in its module keeps the traceback.

    Raises:
        InputError: there is no such module, or it does not define the object.
    """
    module, colon, attribute = name.partition(":")
    with working_folder():
        if not colon:
            return next(iter(find_entry_points(kind, name, form))).load()
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
    """In the context, also search for modules in the working directory, after all locations on the path."""
    folder = str(Path.cwd())
    if folder in sys.path:
        yield
        return
    sys.path.append(folder)
    try:
        yield
    finally:
        with suppress(ValueError):  # The module may have changed the list, too
            sys.path.remove(folder)
