"""What a mission asks for, as data: names for the files, a clock, tasks, rewards and penalties."""

import re
from dataclasses import dataclass, field, fields
from datetime import datetime
from typing import Literal

from pipeline.errors import InputError

HANDED_IN = "handed_in"  # The folder of the files, in that of the run
Task = Literal["explore", "find", "home", "park"]
"""Map the arena, report what is in it, be back at the start in time, end beside victims that are alive."""
DEFAULT_START = datetime.fromisoformat("2026-01-26T14:30:00")
"""Start of a mission that names none: a fixed one, so that files are equal by seed."""


@dataclass(frozen=True)
class Rewards:
    """What the leagues pay for; where a rulebook leaves a number to the judges, the default is an assumption.

    Attributes:
        detection: points for each find (DS), Rescue Robot League; how many is not public.
        extra: bonus of a 3D map for each of rgb, normals and confidence, as a share; how much is not public.
        teleoperated, autonomous: factors of a run by who drives, Rescue Robot League 2026D.
        beta: share of the portals in the score, Virtual Robot 2022: above 0.1 and below 1, by the map's designer.
        reading: points for each code read, small league 2026.
        placed: points more for a code whose distances on the map are right, small league 2026.
        near_fiducials: m that these distances may be off, small league 2026.
        reading_alone: factor of readings that nobody drove for, small league 2026.
        alpha: difficulty of the map, Virtual Robot 2022: above 0.1 and below 2, by the map's designer.
        beside: m from a victim within which marks and robots count, Virtual Robot 2022.
    """

    detection: float = 1.0
    extra: float = 0.1
    teleoperated: float = 1.0
    autonomous: float = 5.0
    beta: float = 0.5
    alpha: float = 1.0
    beside: float = 1.5
    reading: float = 1.0
    placed: float = 4.0
    near_fiducials: float = 0.3
    reading_alone: float = 4.0


@dataclass(frozen=True)
class Penalties:
    """What costs points.

    Attributes:
        contact: share of a living victim's points lost at each contact with it, Virtual Robot 2022.
        wrong: points lost, in those of a victim, for a mark where none is, Virtual Robot 2022.
        reset: points lost at each reset in the labyrinth; 0, for the summary of the rules names none.
    """

    contact: float = 0.2
    wrong: float = 0.5
    reset: float = 0.0


@dataclass(frozen=True)
class MissionBrief:
    """A mission before it begins.

    Attributes:
        team, country, name: for names and headers of files; ``name`` is the mission's.
        start: when the clock starts.
        minutes: that the clock runs, simulated or real; 20 in both leagues.
        tasks: what counts.
        rewards, penalties: in points.
    """

    team: str = "sarsim"
    country: str = "none"
    name: str = "mission"
    start: datetime = DEFAULT_START
    minutes: float = 20.0
    tasks: tuple[Task, ...] = ("explore", "find")
    rewards: Rewards = field(default_factory=Rewards)
    penalties: Penalties = field(default_factory=Penalties)

    def __post_init__(self) -> None:
        """Raises InputError if a number or a name cannot be."""
        for name in ("team", "country", "name"):
            if not getattr(self, name).strip() or re.search(r"[\x00-\x1f\x7f]", getattr(self, name)):
                raise InputError(f"mission: {name} {getattr(self, name)!r}: must be one line, not empty")
        if not 0 < self.minutes < float("inf"):
            raise InputError(f"mission: minutes {self.minutes:g}: minutes must be positive")
        if len(set(self.tasks)) < max(len(self.tasks), 1):
            raise InputError(
                f"mission: tasks {', '.join(self.tasks) or 'none'}: give at least one, and each only once"
            )
        for part in (self.rewards, self.penalties):
            for entry in fields(part):
                if not 0 <= (value := getattr(part, entry.name)) < float("inf"):
                    raise InputError(f"mission: {entry.name} {value:g}: must be finite and not negative")

    @property
    def stem(self) -> str:
        """``RoboCup[Year]-[Team]-[Mission]``, with _ for what would part the name or lead to another folder."""
        team, name = (re.sub(r"\W+", "_", text) for text in (self.team, self.name))
        return f"RoboCup{self.start.year}-{team}-{name}"

    @property
    def plan_name(self) -> str:
        """Name of the 2D map, Rescue Robot League 2026D."""
        return f"{self.stem}.tiff"

    @property
    def cloud_name(self) -> str:
        """Name of the 3D map; an assumption, after that of the 2D map: the summary of the rules gives none."""
        return f"{self.stem}.ply"

    @property
    def codes_name(self) -> str:
        """Name of the file of QR codes; an assumption: the small league asks for a file without naming it."""
        return f"{self.stem}-{self.start:%H-%M-%S}-codes.json"

    @property
    def pois_name(self) -> str:
        """Name of the list of finds, Rescue Robot League 2026D; the form of the start time is an assumption."""
        return f"{self.stem}-{self.start:%H-%M-%S}-pois.csv"
