"""User-defined methods named by a flag: loaded, created, tried out, and checked while they run.

A name is MODULE:CLASS (for an arena, MODULE:FUNCTION), searched for on PYTHONPATH and in the working directory, or an
entry point that an installed package registers in the group ``sarsim.<flag>``, such as ``sarsim.exploration``.
"""

import inspect
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from pipeline.errors import InputError
from pipeline.exploration.baselines import NearestFrontier, RandomWalk
from pipeline.exploration.config import ExplorationConfig
from pipeline.exploration.viewpoint import Strategy
from pipeline.finds.readers import FindReader
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.localisation import Localisation, LostError
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.localisation.slam import Slam
from pipeline.planning.path_plan import TOPOLOGICAL, Planner
from pipeline.robot import RobotModel
from pipeline.semantic_map.classifier import PointClassifier
from pipeline.sink import Sink
from pipeline.topological_map.topological_map import TopologicalMap
from pipeline.victims.detection.detection import Detector
from sarsim.methods import answers
from sarsim.methods.level_ground import level_context, level_frame
from sarsim.methods.names import OWN_CLASS, OWN_FUNCTION, own_method, working_folder


def make_exploration(
    name: str, robot: RobotModel, seed: int = 0, config: ExplorationConfig = ExplorationConfig()
) -> Strategy | None:
    """The strategy that ``--exploration`` names; None for the explorer's default. ``seed``: seed of the random walk.

    Raises:
        InputError: there is no such class, or a trial step on level ground shows that it is not a strategy.
    """
    if name == "next_best_view":
        return None
    if name == "nearest_frontier":
        return NearestFrontier(robot, config=config)
    if name == "random_walk":
        return RandomWalk(robot, seed)
    tried = _own("exploration", name, Strategy, robot)  # For the trial only: a strategy remembers what it has seen
    context = level_context(robot)
    tried.observe(context)
    if (viewpoint := tried.next_viewpoint(context)) is not None:
        tried.commit(viewpoint, context)
    return _own("exploration", name, Strategy, robot)


def make_localisation(
    name: str, robot: RobotModel, config: LocalisationConfig, is_true: bool = False
) -> Localisation:
    """The localisation that ``--localisation`` names; ``is_true``: whether the odometry gives the true pose.

    Raises:
        InputError: there is no such class, or a first keyframe shows that it is not a localisation.
    """
    if name == "odometry" or (name == "slam" and is_true):
        return OdometryLocalisation(config=config)
    if name == "slam":
        return Slam(config=config)
    frame = level_frame()
    tried = _own("localisation", name, Localisation, robot)
    tried.add(tried.localise(frame))
    tried.optimise()
    answers.check_poses(tried.poses, _where("localisation", name))
    return _own("localisation", name, Localisation, robot)


def make_planner(name: str, robot: RobotModel) -> Planner:
    """The planner that ``--planner`` names.

    Raises:
        InputError: there is no such class, or a trial plan on level ground shows that it is not a planner.
    """
    if name == "topological":
        return TOPOLOGICAL
    planner, context = _own("planner", name, Planner, robot), level_context(robot)
    planner.plan(TopologicalMap(), context.paths, np.array([robot.length, 0.0]), None)
    return planner


def own_classifier(name: str) -> PointClassifier:
    """The user-defined point classifier that ``--labels`` names.

    Raises:
        InputError: there is no such class, or an image of level ground shows that it is not a classifier.
    """
    classifier, frame = _own("labels", name, PointClassifier), level_frame()
    classifier.classify(frame, frame.points(frame.T_base_camera), frame.T_base_camera)
    return classifier


def own_detector(name: str) -> Detector:
    """The detector that ``--detector-class`` names.

    Raises:
        InputError: there is no such class, or a black image shows that it is not a detector.
    """
    detector = _own("detector-class", name, Detector)
    detector.detect(level_frame().rgb)
    return detector


def own_reader(name: str) -> FindReader:
    """The reader of finds that ``--reader`` names.

    Raises:
        InputError: there is no such class, or a black image shows that it is not a reader.
    """
    reader: FindReader = _own("reader", name, FindReader)
    reader.read(level_frame(), [])
    return reader


def own_sink(name: str) -> Sink:
    """The sink that ``--sink`` names; InputError if there is no such class, or it is not a sink."""
    sink: Sink = _own("sink", name, Sink)
    return sink


def own_arena(name: str, seed: int) -> Any:
    """The return value of the function that ``--arena`` names, which gets the seed if it has such a parameter.

    Raises:
        InputError: there is no such function, or it fails.
    """
    where, build = _where("arena", name), _loaded("arena", name, OWN_FUNCTION)
    if not callable(build):
        raise InputError(f"{where}: must name a function, not {answers.kind_of(build)}")
    try:
        return build(seed=seed) if "seed" in inspect.signature(build).parameters else build()
    except Exception as error:
        said = str(error) if isinstance(error, InputError) else answers.one_line(error)
        raise InputError(f"{where} failed: {said}") from error


def _own(flag: str, name: str, protocol: type, *args: RobotModel) -> Any:
    """An instance of a class with the members of a protocol, whose return values are checked from then on."""
    where = _where(flag, name)
    kind, remedy = load_class(flag, name), f"implement the interface {protocol.__module__}.{protocol.__name__}"
    method, attributes = _guarded(kind, f"{where}: creating an instance")(*args), inspect.get_annotations(protocol)
    for member, wanted in vars(protocol).items():
        if member.startswith("_") or member in attributes:
            continue
        if member not in dir(method):
            if inspect.isabstract(protocol) and not getattr(wanted, "__isabstractmethod__", False):
                setattr(method, member, wanted.__get__(method))  # The protocol's default
                continue
            what = "method" if inspect.isfunction(wanted) else "attribute"
            raise InputError(f"{where}: the class has no {what} {member}; {remedy}")
        if inspect.isfunction(wanted):
            _watch(method, member, len(inspect.signature(wanted).parameters) - 1, where)
    # An attribute with a default may be missing.
    if missing := [name for name in attributes if not (hasattr(protocol, name) or name in dir(method))]:
        raise InputError(f"{where}: the class has no attribute {missing[0]}; {remedy}")
    return method


def load_class(flag: str, name: str) -> Callable[..., Any]:
    """The class with a given name; InputError if there is none."""
    loaded = _loaded(flag, name, OWN_CLASS)
    if ":" in name and not inspect.isclass(loaded):
        raise InputError(f"{_where(flag, name)}: must name a class, not {answers.kind_of(loaded)}")
    return loaded


def _loaded(flag: str, name: str, form: str) -> Any:
    """The object that a name of a given form stands for; InputError if there is none."""
    where, (module, colon, kind) = _where(flag, name), name.partition(":")
    found = () if colon else own_method(flag, name, form)
    try:
        with working_folder():
            return getattr(import_module(module), kind) if colon else next(iter(found)).load()
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{where} cannot be loaded: {answers.one_line(error)}") from error


def _watch(method: Any, member: str, count: int, where: str) -> None:
    """Wrap a method of an instance to check its return value and errors."""
    function, name = getattr(method, member), f"{where}: {member}"
    try:
        inspect.signature(function).bind(*range(count))
    except (TypeError, ValueError) as error:
        call = {0: "without arguments", 1: "with one argument"}.get(count, f"with {count} arguments")
        raise InputError(f"{name}: must be callable {call}: {answers.one_line(error)}") from error
    try:
        setattr(method, member, _guarded(function, name, answers.CHECKS.get(member)))
    except AttributeError as error:
        raise InputError(
            f"{where}: the methods of an instance must be replaceable ({answers.one_line(error)}); "
            "remove __slots__ and frozen=True from the class"
        ) from error


def _guarded(function: Callable[..., Any], name: str, check: Callable[..., None] | None = None) -> Callable[..., Any]:
    """Wrap a function: its errors, and values that ``check`` rejects, become InputErrors that begin with ``name``."""

    def guarded(*args: Any) -> Any:
        try:
            answer = function(*args)
        except (InputError, LostError):
            raise
        except Exception as error:
            raise InputError(f"{name} failed: {answers.one_line(error)}") from error
        if check is not None:
            check(answer, name, *args)
        return answer

    return guarded


def _where(flag: str, name: str) -> str:
    return f"--{flag} {name}"
