"""A robot's parameters, read from its MJCF as plain XML, because programs for real robots run without a simulator."""

import sys
from dataclasses import fields, replace
from typing import TypeVar

from pipeline.datasets.depth_cameras import with_overrides
from pipeline.errors import InputError
from pipeline.robot import RobotModel
from pipeline.sensor import XTION, SensorModel
from sarsim.robots.names import ROBOTS, robot_file
from sarsim.robots.skid_steer import DriveModel
from sarsim.vetting.model_files import parse_mjcf

DEPTH_RANGE = "depth_range"  # Name of the only ``<numeric>`` that a file may omit
PLAUSIBLE_RANGE = 1e-3, 10.0
"""Minimum and maximum plausible parameter of a robot that drives in buildings, in m, rad and their rates."""
Model = TypeVar("Model", RobotModel, DriveModel)


def robot_model(robot: str = ROBOTS[0]) -> RobotModel:
    """Parameters of a robot for the pipeline; InputError if its file or a number is missing or invalid."""
    return _read_model(RobotModel, robot)


def drive_model(robot: str = ROBOTS[0]) -> DriveModel:
    """Parameters of a robot for its firmware; raises InputError like :func:`robot_model`."""
    return _read_model(DriveModel, robot)


def paced_model(robot: str, speed: float | None) -> RobotModel:
    """Like :func:`robot_model`, but with ``speed`` m/s, limited to the top speed; None keeps the robot's speed.

    The robot's speed on ramps, which is also its speed when it backs out, is limited to ``speed`` as well.
    """
    model, top = robot_model(robot), drive_model(robot).top_speed
    if speed is not None and speed > top:
        print(f"--speed {speed:g}: limited to the robot's top speed of {top:g} m/s", file=sys.stderr)
    if speed is None:
        return model
    return replace(model, speed=min(speed, top), ramp_speed=min(speed, model.ramp_speed))


def robot_sensor(robot: str = ROBOTS[0]) -> SensorModel | None:
    """The robot's camera, whose depth range, m, is read from ``<numeric name="depth_range">`` in the robot's file.

    Returns:
        The camera, with the noise of an Xtion; None if the file gives no range.

    Raises:
        InputError: the file is missing or invalid, or the range is invalid.
    """
    given = _numbers(robot).get(DEPTH_RANGE)
    if given is None:
        return None
    if len(given) != 2:
        raise InputError(f'--robot {robot}: <numeric name="{DEPTH_RANGE}"> needs two numbers; found {len(given)}')
    try:
        return with_overrides(XTION, (given[0], given[1]), names=(DEPTH_RANGE, "the noise"))
    except InputError as error:
        raise InputError(f"--robot {robot}: {error}") from error


def _numbers(robot: str) -> dict[str, list[float]]:
    """The ``<numeric>`` elements of a robot's file, by name."""
    path = robot_file(robot)
    try:
        elements = [e for root in parse_mjcf(path).values() for e in root.iter("numeric")]
        return {e.get("name", ""): [float(number) for number in e.get("data", "").split()] for e in elements}
    except InputError as error:
        raise InputError(f"--robot {error}") from error
    except ValueError as error:
        raise InputError(f"--robot {robot}: the data of a <numeric> must be numbers: {error}") from error


def _read_model(kind: type[Model], robot: str) -> Model:
    """An instance of ``kind`` whose fields have the values of the ``<numeric>`` elements with the same names."""
    numbers, (least, most) = _numbers(robot), PLAUSIBLE_RANGE
    values = {field.name: numbers.get(field.name, []) for field in fields(kind)}
    for name, value in values.items():
        if len(value) != 1 or not least <= value[0] <= most:
            proper = f'<numeric name="{name}"> with one number from {least:g} to {most:g}'
            found = " ".join(f"{number:g}" for number in value) or "none"
            raise InputError(f"--robot {robot}: <custom> needs {proper}; found {found}")
    return kind(**{name: value for name, (value,) in values.items()})
