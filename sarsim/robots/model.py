"""The numbers of a robot, from its MJCF as mere XML: a program for a real robot needs them, and no simulator."""

from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import TypeVar

import numpy as np
from defusedxml import DefusedXmlException, ElementTree

from pipeline.errors import InputError
from pipeline.robot import RobotModel
from sarsim.assets import asset
from sarsim.robots.skid_steer import DriveModel

ROBOTS = ("pioneer3at", "jackal")
"""Names of the robots that sarsim ships."""
Model = TypeVar("Model", RobotModel, DriveModel)


def robot_file(robot: str) -> Path:
    """Path of the MJCF of one of ``ROBOTS``; any other ``robot`` is itself a path."""
    return asset("robots", robot, f"{robot}.xml") if robot in ROBOTS else Path(robot)


def robot_model(robot: str = ROBOTS[0]) -> RobotModel:
    """Parameters of a robot for the pipeline; InputError if its file or a number is missing or broken."""
    return _filled(RobotModel, robot)


def drive_model(robot: str = ROBOTS[0]) -> DriveModel:
    """Parameters of a robot for its firmware; raises InputError as :func:`robot_model` does."""
    return _filled(DriveModel, robot)


def _filled(kind: type[Model], robot: str) -> Model:
    """A ``kind`` whose fields are the positive numbers of the same names."""
    try:
        numbers = dict(_numbers(robot_file(robot)))
    except OSError as error:
        raise InputError(f"--robot {robot}: {error.strerror or error}; known are {', '.join(ROBOTS)}") from error
    except (ElementTree.ParseError, DefusedXmlException, ValueError) as error:
        raise InputError(f"--robot {robot}: not readable MJCF: {' '.join(str(error).split())}") from error
    values = {field.name: numbers.get(field.name, []) for field in fields(kind)}
    for name, value in values.items():
        if len(value) != 1 or not 0 < value[0] < np.inf:
            raise InputError(f'--robot {robot}: <custom> has no proper <numeric name="{name}">: {value}')
    return kind(**{name: value for name, (value,) in values.items()})


def _numbers(path: Path) -> Iterator[tuple[str, list[float]]]:
    """Name and values of each ``<numeric>`` of a file and of those that it includes."""
    for element in ElementTree.parse(path).iter():
        if element.tag == "include":
            yield from _numbers(path.parent / element.get("file", ""))
        elif element.tag == "numeric":
            yield element.get("name", ""), [float(number) for number in element.get("data", "").split()]
