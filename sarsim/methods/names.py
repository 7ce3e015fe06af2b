"""Names of methods, known without loading any, so that a wrong one is refused at once."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import EntryPoints, entry_points
from importlib.util import find_spec
from pathlib import Path

from pipeline.errors import InputError
from sarsim.settings import METHODS

OWN_CLASS, OWN_FUNCTION = "MODULE:CLASS", "MODULE:FUNCTION"


def check_method(kind: str, name: str, flag: str = "") -> None:
    """Check that a name is that of a shipped method, of an entry point, or begins with a module that is there.

    Args:
        kind: one of ``METHODS``.
        name: of a method.
        flag: that names it, for the message, if it is not called like the kind.

    Raises:
        InputError: there is no such method; the message says which there are.
    """
    module, colon, _ = name.partition(":")
    if colon:
        top, _, _ = module.partition(".")
        with working_folder():
            is_there = bool(top) and find_spec(top) is not None
        if not is_there:
            raise InputError(f"--{flag or kind} {name}: no module {top!r} on PYTHONPATH or in the working directory")
    elif name not in METHODS[kind]:
        own_method(kind, name, flag=flag)


def own_method(kind: str, name: str, form: str = OWN_CLASS, flag: str = "") -> EntryPoints:
    """The entry points of that name; InputError, with the names that there are, if there is none."""
    group = f"sarsim.{kind.replace('-', '_')}"
    if not (found := entry_points(group=group, name=name)):
        known = ", ".join([*METHODS[kind], *sorted(entry_points(group=group).names)])
        raise InputError(f"--{flag or kind} {name}: must be {known}{' or ' if known else ''}{form}")
    return found


@contextmanager
def working_folder() -> Iterator[None]:
    """Look for modules in the working folder too, after all others."""
    sys.path.append(str(Path.cwd()))
    try:
        yield
    finally:
        sys.path.pop()
