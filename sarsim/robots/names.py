"""Names of robots, in a module without slow imports, so that a wrong name is refused at once."""

from pathlib import Path

from pipeline.errors import InputError
from sarsim.assets import asset

ROBOTS = ("pioneer3at", "jackal")
"""Names of the robots that sarsim ships."""


def robot_file(robot: str) -> Path:
    """Path of a robot's MJCF; a ``robot`` that is not one of ``ROBOTS`` is itself the path.

    Raises:
        InputError: the file does not exist.
    """
    path = asset("robots", robot, f"{robot}.xml") if robot in ROBOTS else Path(robot)
    if not path.exists():
        raise InputError(
            f"--robot {robot}: no such robot or file; use {', '.join(ROBOTS)} or the path of an MJCF file"
        )
    return path
