"""Report everything in a mission's files that a judge would reject: ``validate_mission.py DIR``."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from tyro.conf import Fixed

from pipeline.plugins.league.config import ValidationConfig
from sarsim.commands.settings import run_with_settings

REJECTED = 1  # Exit status if a file is invalid


@dataclass(frozen=True, kw_only=True)
class MissionValidation:
    """The files to check, and the limits of the checks.

    Attributes:
        path: folder of the files, or an episode's folder that contains handed_in/.
        tolerances: limits of the validation; set them in a ``--config`` file.
    """

    path: Annotated[Path, tyro.conf.Positional]
    tolerances: Fixed[ValidationConfig] = ValidationConfig()


def validate_mission(config: MissionValidation) -> None:
    """Check the 2D map, 3D map and list of finds that a team submits.

    The exit status is 1 if a file is invalid.
    """
    from pipeline.plugins.league.validation import validate

    errors = validate(config.path, config=config.tolerances)
    print("\n".join(errors) or f"{config.path}: all files are valid")
    if errors:
        sys.exit(REJECTED)


def main() -> None:
    """Entry point of ``sarsim-validate-mission``."""
    run_with_settings(validate_mission, MissionValidation)
