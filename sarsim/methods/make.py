"""Creates the robot's methods that flags name: shipped methods and user-defined classes."""

import inspect
from typing import Any

from pipeline.errors import InputError
from pipeline.exploration.baselines import NearestFrontier, RandomWalk
from pipeline.exploration.config import ExplorationConfig
from pipeline.exploration.viewpoint import Strategy
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.localisation import Localisation
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.localisation.slam import Slam
from pipeline.planning.path_plan import TOPOLOGICAL, Planner
from pipeline.robot import RobotModel
from sarsim.methods.names import OWN_CLASS, load_own


def make_exploration(
    name: str, robot: RobotModel, seed: int = 0, config: ExplorationConfig = ExplorationConfig()
) -> Strategy | None:
    """The strategy that ``--exploration`` names; None for the explorer's default.

    ``seed``: seed of the random walk.

    Raises:
        InputError: see :func:`make_own`.
    """
    if name == "next_best_view":
        return None
    if name == "nearest_frontier":
        return NearestFrontier(robot, config=config)
    if name == "random_walk":
        return RandomWalk(robot, seed)
    strategy: Strategy = make_own("exploration", name, Strategy, robot)
    return strategy


def make_localisation(
    name: str, robot: RobotModel, config: LocalisationConfig, is_true: bool = False
) -> Localisation:
    """The localisation that ``--localisation`` names; ``is_true``: whether the odometry gives the true pose.

    Raises:
        InputError: see :func:`make_own`.
    """
    if name == "odometry" or (name == "slam" and is_true):
        return OdometryLocalisation(config=config)
    if name == "slam":
        return Slam(config=config)
    localisation: Localisation = make_own("localisation", name, Localisation, robot)
    return localisation


def make_planner(name: str, robot: RobotModel) -> Planner:
    """The planner that ``--planner`` names.

    Raises:
        InputError: see :func:`make_own`.
    """
    return TOPOLOGICAL if name == "topological" else make_own("planner", name, Planner, robot)


def make_own(flag: str, name: str, interface: type, *args: RobotModel) -> Any:
    """An instance of the user-defined class that a flag names; an error in the class keeps its traceback.

    Raises:
        InputError: there is no such class, or the class lacks a member of ``interface``; if the interface has
            abstract methods, only these methods are required.
    """
    loaded = load_own(flag, name, OWN_CLASS)
    if not inspect.isclass(loaded):
        raise InputError(f"--{flag} {name}: must name a class, not a {type(loaded).__name__}")
    method = loaded(*args)
    members = getattr(interface, "__abstractmethods__", None) or {
        *vars(interface),
        *inspect.get_annotations(interface),
    }
    lacking = sorted(member for member in members if not (member.startswith("_") or hasattr(method, member)))
    if lacking:
        where = f"{interface.__module__}.{interface.__name__}"
        raise InputError(f"--{flag} {name}: the class has no {', '.join(lacking)}; implement the interface {where}")
    return method
