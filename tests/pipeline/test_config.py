"""The numbers of a run's one tree are those that the whole robot uses: nobody forgets to pass them on."""

import sys
import threading
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from types import FrameType, FunctionType, MethodType
from typing import Any

import pytest

import pipeline
from pipeline.config import PipelineConfig
from pipeline.explorer import Explorer
from pipeline.frame import Frame
from pipeline.robot import Velocity
from sarsim.composition import make_mapper
from sarsim.settings import PerceptionConfig
from tests.pipeline.kinematic_robot import KinematicRobot
from tests.pipeline.localisation.carried_robot import ROOM, seen
from tests.pipeline.robot_model import PIONEER

CODE = str(Path(pipeline.__file__).parent)


class SeeingRobot(KinematicRobot):
    """Sees a room, with perfect odometry."""

    def sense(self) -> Frame:
        return replace(seen(ROOM, self.T, seed=len(self.commands)), time=float(len(self.commands)))


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
    """Notes which parts of a tree of configs are in use, and who uses others of their classes."""

    def __init__(self, config: PipelineConfig) -> None:
        own = list(parts_of(config))
        self._own, self._kinds = {id(part) for part in own}, {type(part) for part in own}
        self._config, self.used, self.foreign = config, set[type](), set[str]()

    def note(self, user: str, value: Any) -> None:
        if type(value) in self._kinds:
            self.used.add(type(value))
            if id(value) not in self._own:
                self.foreign.add(f"{user}: {type(value).__name__}")

    def note_held(self, *roots: Any) -> None:
        """What is reachable from these objects."""
        left, met = list(roots), dict[int, Any]()
        while left:
            holder = left.pop()
            if id(holder) not in met:
                met[id(holder)] = holder
                held = held_by(holder)
                left += held
                for value in held:
                    self.note(type(holder).__qualname__, value)

    def note_call(self, frame: FrameType, event: str, _: Any) -> None:
        """What is passed to functions of the pipeline, explicitly or by default."""
        if event == "call" and frame.f_code.co_filename.startswith(CODE):
            for value in list(frame.f_locals.values()):
                self.note(f"{frame.f_code.co_filename[len(CODE) + 1 :]} {frame.f_code.co_qualname}", value)


@pytest.mark.parametrize("labels", ["rules", "pointnext"])
def test_all_numbers_are_those_of_the_one_tree(labels: str) -> None:
    config, robot = fresh(PipelineConfig()), SeeingRobot()
    assert config == PipelineConfig()
    audit = Audit(config)
    threading.setprofile(audit.note_call)
    sys.setprofile(audit.note_call)
    try:
        mapper = make_mapper(PerceptionConfig(labels=labels, pipeline=config), PIONEER)
        explorer = Explorer(robot, mapper)
        for _ in range(2):
            explorer.drive(explorer.step())
            robot.drive(Velocity(0.0, 1.0))
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    audit.note_held(explorer, mapper)
    print(sorted(k.__name__ for k in {type(part) for part in parts_of(config)} - audit.used))
    assert not audit.foreign
    assert {type(getattr(config, f.name)) for f in fields(config)} <= audit.used | {type(config.victims)}
