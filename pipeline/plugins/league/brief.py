"""The brief of a mission: names for the files, a clock, tasks, rewards and penalties."""

import re
from dataclasses import dataclass, field, fields
from datetime import datetime
from typing import Literal

from pipeline.errors import InputError

HANDED_IN = "handed_in"  # Folder of the files, in the folder of the run
Task = Literal["explore", "find", "home", "park"]
"""A task: map the arena, report the finds in it, return to the start in time, or end next to living victims."""
DEFAULT_START = datetime.fromisoformat("2026-01-26T14:30:00")
"""Start of a mission whose brief names none; it is fixed so that the same seed gives the same files."""


@dataclass(frozen=True)
class Rewards:
    """Points that the leagues award; where a rule book leaves a number to the judges, the default is an assumption.

    Attributes:
        detection: points for each correct find (DS), Rescue Robot League; the official number is not public.
        extra: bonus for each of RGB, normals and confidence in the 3D map, as a fraction of the map's points; the
            official number is not public.
        teleoperated, autonomous: factors on the points of teleoperated and of autonomous runs, Rescue Robot League
            2026D.
        beta: weight of the portals in the score, Virtual Robot 2022; set by the map's designer between 0.1 and 1.
        reading: points for each code that is read, small league 2026.
        placed: additional points for a code whose distances on the map are correct, small league 2026.
        near_fiducials: maximum error of these distances, m, small league 2026.
        reading_alone: factor on the points of a run in which nobody drives the robot, small league 2026.
        alpha: difficulty of the map, Virtual Robot 2022; set by the map's designer between 0.1 and 2.
        beside: maximum distance between a victim and a mark or robot that is credited to the victim, m, Virtual Robot
            2022.
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
    """Points that the leagues deduct.

    Attributes:
        contact: fraction of a living victim's points that each contact with it costs, Virtual Robot 2022.
        wrong: fraction of a victim's points that a wrong mark costs, Virtual Robot 2022. A wrong mark of a living
            victim costs more, according to the formula of the score.
        reset: points that each reset in the labyrinth costs; 0, because the summary of the rules names no penalty.
    """

    contact: float = 0.2
    wrong: float = 0.5
    reset: float = 0.0


@dataclass(frozen=True)
class MissionBrief:
    """The brief of a mission, which is fixed before the mission starts.

    Attributes:
        team, country, name: names of the team, its country and the mission, for file names and headers.
        start: date and time at which the clock starts.
        minutes: duration, min, simulated or real; 20 in the Rescue Robot League and in Virtual Robot.
        tasks: tasks of the robot, at least one.
        rewards, penalties: points awarded and lost.
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
        """Raise InputError if a name, a number or the list of tasks is invalid."""
        for name in ("team", "country", "name"):
            if not getattr(self, name).strip() or re.search(r"[\x00-\x1f\x7f]", getattr(self, name)):
                rule = "must not be empty or contain line breaks or other control characters"
                raise InputError(f"mission: {name} = {getattr(self, name)!r}: {rule}")
        if not 0 < self.minutes < float("inf"):
            raise InputError(f"mission: minutes = {self.minutes:g}: must be positive and finite")
        if len(set(self.tasks)) < max(len(self.tasks), 1):
            raise InputError(
                f"mission: tasks = [{', '.join(self.tasks)}]: must contain at least one task, and each only once"
            )
        for group, part in (("rewards", self.rewards), ("penalties", self.penalties)):
            for entry in fields(part):
                if not 0 <= (value := getattr(part, entry.name)) < float("inf"):
                    raise InputError(f"mission: {group}.{entry.name} = {value:g}: must be non-negative and finite")

    @property
    def stem(self) -> str:
        """``RoboCup[Year]-[Team]-[Mission]``, with _ in place of all characters except letters and digits."""
        team, name = (re.sub(r"\W+", "_", text) for text in (self.team, self.name))
        return f"RoboCup{self.start.year}-{team}-{name}"

    @property
    def map_2d_name(self) -> str:
        """File name of the 2D map, Rescue Robot League 2026D."""
        return f"{self.stem}.tiff"

    @property
    def cloud_name(self) -> str:
        """File name of the 3D map, by analogy with the 2D map, because the summary of the rules gives no name."""
        return f"{self.stem}.ply"

    @property
    def codes_name(self) -> str:
        """File name of the QR codes; an assumption, because the small league specifies no name for this file."""
        return f"{self.stem}-{self.start:%H-%M-%S}-codes.json"

    @property
    def pois_name(self) -> str:
        """File name of the list of finds, Rescue Robot League 2026D; the start time's format is an assumption."""
        return f"{self.stem}-{self.start:%H-%M-%S}-pois.csv"
