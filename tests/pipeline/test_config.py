"""The numbers of a run's one tree are those that the whole robot uses: nobody forgets to pass them on."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass, replace
from functools import partial
from pathlib import Path
from types import FrameType, FunctionType, MethodType
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import pipeline
from pipeline.config import PipelineConfig
from pipeline.explorer import Explorer
from pipeline.finds.objects import policy_of
from pipeline.frame import Frame
from pipeline.semantic_map.networks.blocks import BlockConfig
from pipeline.tracks.config import TracksConfig
from pipeline.tracks.find import KINDS
from pipeline.transforms import from_yaw
from pipeline.victims.detection.detection import Detection
from sarsim.composition import make_mapper
from sarsim.methods.make import make_exploration
from sarsim.settings import PerceptionConfig
from tests.pipeline.kinematic_robot import KinematicRobot
from tests.pipeline.localisation.carried_robot import ROOM, seen
from tests.pipeline.robot_model import PIONEER

CODE = str(Path(pipeline.__file__).parent)


class SeeingRobot(KinematicRobot):
    """Sees a room and how warm it is, with perfect odometry."""

    def __init__(self) -> None:
        super().__init__()
        self.T = from_yaw(1.0, 2.0, 0.0, 0.0)

    def sense(self) -> Frame:
        frame, thermal = seen(ROOM, self.T, seed=len(self.commands)), np.full((60, 80), 20.0, np.float32)
        thermal[20:30, 20:30] = 30.0
        return replace(frame, time=float(len(self.commands)), thermal=thermal)


class SeesEverything:
    """A detector that finds an object of every kind in the middle of each image."""

    def detect(self, rgb: NDArray[np.uint8]) -> list[Detection]:
        height, width, _ = rgb.shape
        return [Detection((0.4 * width, 0.4 * height, 0.6 * width, 0.7 * height), 0.9, kind) for kind in KINDS]


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
    """Notes what configs are in use that are no parts of a tree of configs.

    Attributes:
        foreign: them and their users.
    """

    def __init__(self, config: PipelineConfig) -> None:
        self._own = {id(part): part for part in parts_of(config)}
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


@pytest.mark.parametrize(("labels", "exploration"), [("rules", "nearest_frontier"), ("pointnext", "next_best_view")])
def test_all_numbers_are_those_of_the_one_tree(labels: str, exploration: str) -> None:
    config, robot = fresh(PipelineConfig()), SeeingRobot()
    assert config == PipelineConfig()
    audit = Audit(config)
    with audit.calls():
        mapper = make_mapper(PerceptionConfig(labels=labels, pipeline=config), PIONEER)
        explorer = Explorer(robot, mapper, make_exploration(exploration, PIONEER, config=config.exploration))
        for _ in range(2):
            explorer.drive(explorer.step())
        frame, T_map_base = robot.sense(), mapper.keyframes.poses[-1]
        detections = SeesEverything().detect(frame.rgb)
        assert mapper.readers is not None
        mapper.victims.update(frame, detections, T_map_base @ frame.T_base_camera)
        mapper.finds.update(frame, mapper.readers.read(frame, detections), T_map_base, 0)
        assert len(mapper.semantic_map.labels())
    audit.note_held(explorer, mapper)
    assert audit.foreign == set()


class Half:
    """Passes on one of two configs."""

    def __init__(self, config: PipelineConfig) -> None:
        self.finds, self.tracks = config.finds, TracksConfig()


def test_a_config_that_is_not_passed_on_is_seen() -> None:
    config = fresh(PipelineConfig())
    held, called = Audit(config), Audit(config)
    held.note_held([partial(print, Half(config))])
    assert held.foreign == {"Half: TracksConfig"}
    with called.calls():
        policy_of("heat", config.tracks)
        assert called.foreign == set()
        policy_of("heat", TracksConfig())
    assert called.foreign == {"finds/objects.py policy_of: TracksConfig"}
