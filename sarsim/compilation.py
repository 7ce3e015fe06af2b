"""Compilation of an episode's functions on two cores: a second process fills numba's cache in reverse order.

numba compiles each function when it is first called, which takes a minute in total on a new machine. The
second process works through ``kernels.json`` backwards, starting with the function that an episode needs last, until
it reaches the functions that the first process has compiled.
"""

import functools
import json
import sys
from collections.abc import Iterable
from contextlib import suppress
from importlib import import_module
from importlib.resources import files
from subprocess import DEVNULL, Popen
from typing import Any

from pipeline.processes import end_with_parent, usable_cores

Argument = str | list[Any]
"""An argument's type: the name of a scalar type, ``["array", dtype, dimensions, layout, is read-only]``,
``["literal", value]``, ``["omitted", default]`` or ``["tuple", module:class or null, types]``."""


@functools.cache
def compile_on_two_cores() -> None:
    """Start the second process as soon as numba compiles anything, unless this process may use only one core."""
    from numba.core import event  # imported here, because it takes too long for --help

    class Starter(event.Listener):
        is_wanted = usable_cores() > 1

        def on_start(self, event: event.Event) -> None:
            if self.is_wanted:
                self.is_wanted = False
                command = [sys.executable, "-m", "sarsim.compilation"]
                self.process = Popen(
                    command, stdin=DEVNULL, stdout=DEVNULL, stderr=DEVNULL, preexec_fn=end_with_parent
                )

        def on_end(self, event: event.Event) -> None:
            """Do nothing."""

    event.register("numba:compile", Starter())


def listed_functions() -> list[tuple[str, list[Argument]]]:
    """The functions, as ``module:name``, with their argument types, in the order in which an episode needs them."""
    return [(name, arguments) for name, arguments in json.loads((files("sarsim") / "kernels.json").read_text())]


def compile_functions(functions: Iterable[tuple[str, list[Argument]]]) -> None:
    """Compile functions for their argument types into numba's cache; functions that do not compile are skipped."""
    for name, arguments in functions:
        # If the list is older than the code, nothing breaks: functions are compiled when first called.
        with suppress(Exception):
            resolve_name(name).compile(tuple(map(type_of, arguments)))


def resolve_name(name: str) -> Any:
    """The object that ``module:name`` refers to."""
    module, _, attribute = name.partition(":")
    return getattr(import_module(module), attribute)


def type_of(argument: Argument) -> Any:
    """The numba type of an argument."""
    from numba import types  # imported here, because it takes too long for --help

    if isinstance(argument, str):
        return getattr(types, argument)
    kind, *about = argument
    if kind in ("literal", "omitted"):
        return {"literal": types.literal, "omitted": types.Omitted}[kind](*about)
    if kind == "tuple":
        return types.BaseTuple.from_types([type_of(inner) for inner in about[1]], about[0] and resolve_name(about[0]))
    dtype, dimensions, layout, is_readonly = about
    return types.Array(getattr(types, dtype), dimensions, layout, readonly=is_readonly)


if __name__ == "__main__":
    compile_functions(reversed(listed_functions()))
