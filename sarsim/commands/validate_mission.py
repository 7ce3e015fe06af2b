"""Report what a judge would reject in a mission's files: ``validate_mission.py DIR``."""

import sys
from pathlib import Path
from typing import Annotated

import tyro

from sarsim.commands.cli import run

REJECTED = 1  # Exit status


def validate_mission(path: Annotated[Path, tyro.conf.Positional]) -> None:
    """Check the 2D map, 3D map and list of finds that a team hands in; the exit status is 1 if any is rejected.

    Args:
        path: folder of the files, or an episode's that contains handed_in/.
    """
    from pipeline.league.validation import validate

    faults = validate(path)
    print("\n".join(faults) or f"{path}: a judge would reject nothing")
    if faults:
        sys.exit(REJECTED)


def main() -> None:
    """Entry point."""
    run(validate_mission)
