"""What a subject of the benchmark is."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.table import Table


@dataclass(frozen=True)
class Result:
    """What a subject measured."""

    figures: dict[str, float]
    """By name. A ratio says how many times faster than the other in this run."""
    details: dict[str, Any] = field(default_factory=dict)
    """What else belongs into the file, under its own keys."""
    table: Table | None = None
    """For a person to read, where all figures would be too many."""


@dataclass(frozen=True)
class Subject:
    """The flags of a subject are the fields of a subclass."""

    json: Path | None = None
    """File that gets the figures, with the machine and the settings that they hold for."""

    def measure(self) -> Result:
        """Do the work."""
        raise NotImplementedError
