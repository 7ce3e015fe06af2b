"""Report what a judge would reject in a mission's files: ``validate_mission.py DIR``."""

import sys

from sarsim.commands.settings import run_with_settings
from sarsim.settings import MissionValidation

REJECTED = 1  # Exit status


def validate_mission(config: MissionValidation) -> None:
    """Check the 2D map, 3D map and list of finds that a team hands in. The exit status is 1 if any is invalid."""
    from pipeline.plugins.league.validation import validate

    faults = validate(config.path, config=config.io.league.validation)
    print("\n".join(faults) or f"{config.path}: all files are valid")
    if faults:
        sys.exit(REJECTED)


def main() -> None:
    """Entry point."""
    run_with_settings(validate_mission, MissionValidation)
