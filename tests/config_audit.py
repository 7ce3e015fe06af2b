"""Finds configs in use that are no parts of the tree that a run was given."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from types import FrameType, FunctionType, MethodType
from typing import Any

import pipeline
import sarsim.plugins.finds.plugin  # noqa: F401 - imported while calls are watched, it would make default settings
from pipeline.semantic_map.networks.blocks import BlockConfig

CODE = str(Path(pipeline.__file__).parent)


def fresh(config: Any) -> Any:
    """An equal dataclass of which every part is an instance of its own."""
    values = {f.name: getattr(config, f.name) for f in fields(config)}
    return type(config)(**{name: fresh(value) if is_dataclass(value) else value for name, value in values.items()})


def parts_of(config: Any) -> Iterator[Any]:
    """A dataclass, and those in it."""
    yield config
    for f in fields(config):
        if is_dataclass(part := getattr(config, f.name)):
            yield from parts_of(part)


def held_by(holder: Any) -> list[Any]:
    """The objects to which one leads; of others' libraries it is not asked."""
    if isinstance(holder, dict):
        return list(holder.values())
    if isinstance(holder, list | tuple | set | frozenset):
        return list(holder)
    if isinstance(holder, partial):
        return [holder.func, *holder.args, *holder.keywords.values()]
    if isinstance(holder, MethodType):
        return [holder.__self__]
    if isinstance(holder, FunctionType):
        return [cell.cell_contents for cell in holder.__closure__ or ()]
    is_ours = type(holder).__module__.partition(".")[0] in ("pipeline", "sarsim", "tests")
    return list(vars(holder).values()) if is_ours and hasattr(holder, "__dict__") else []


class Audit:
    """Notes what configs are in use that are no parts of some trees of configs.

    Attributes:
        foreign: them and their users.
    """

    def __init__(self, *configs: Any) -> None:
        self._own = {id(part): part for config in configs for part in parts_of(config)}
        self._kinds = {type(part) for part in self._own.values()}
        self.foreign = set[str]()

    def is_config(self, value: Any) -> bool:
        """Whether an object is such a part, or looks like one that the tree lacks."""
        kind = type(value)
        is_ours = kind.__module__.startswith("pipeline.") and kind.__name__.endswith("Config")
        is_of_network = kind is BlockConfig  # stands in the file of its weights
        return kind in self._kinds or (is_ours and is_dataclass(value) and not is_of_network)

    def note(self, user: str, value: Any) -> None:
        if self.is_config(value) and id(value) not in self._own:
            self.foreign.add(f"{user}: {type(value).__name__}")

    def note_held(self, *roots: Any) -> None:
        """What is reachable from these objects."""
        left, met = list(roots), dict[int, Any]()
        while left:
            holder = left.pop()
            if id(holder) not in met and not self.is_config(holder):
                met[id(holder)] = holder
                held = held_by(holder)
                left += held
                for value in held:
                    self.note(type(holder).__qualname__, value)

    @contextmanager
    def calls(self) -> Iterator[None]:
        """Notes what is passed to functions of the pipeline inside a with block, also in threads begun there."""
        threading.setprofile(self.note_call)
        sys.setprofile(self.note_call)
        try:
            yield
        finally:
            sys.setprofile(None)
            threading.setprofile(None)

    def note_call(self, frame: FrameType, event: str, _: Any) -> None:
        """What is passed to a function of the pipeline, explicitly or by default."""
        if event == "call" and frame.f_code.co_filename.startswith(CODE):
            for value in list(frame.f_locals.values()):
                self.note(f"{frame.f_code.co_filename[len(CODE) + 1 :]} {frame.f_code.co_qualname}", value)
