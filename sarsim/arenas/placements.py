"""Victims in arena files, found by model names, and the lists of victims and starts that leagues publish.

A line of a list has the form ``NAME x y z roll pitch yaw``, in m and rad in the world frame, as Gazebo prints poses.
The name may be omitted or be a line number, and the last three numbers may be omitted. Commas, semicolons, colons,
equals signs and brackets are treated as spaces, and ``#`` begins a comment. Lines whose name contains ``start`` or
``robot`` are starts; all other lines are victims. The name on a line without numbers also applies to the nameless
lines below it.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.files import read_text
from pipeline.tracks.find import VICTIM
from pipeline.transforms import FARTHEST
from sarsim.arenas.elements import ArenaBuilder
from sarsim.arenas.settings import StartPose
from sarsim.arenas.things.thing import ALIVE, DEAD, annotate_body
from sarsim.victims.victims import VICTIM_PREFIX, Posture, make_victim

VICTIM_WORDS = ("victim", "survivor", "casualty", "rescue_randy")
"""Words in the names of victims' models; the last is the manikin of DARPA's Subterranean Challenge."""
STATE_WORDS = {"hot": ALIVE, "warm": ALIVE, "moving": ALIVE, "alive": ALIVE, "cold": DEAD, "dead": DEAD}
"""States of victims by words in their names; the Virtual Robot league has hot, cold and moving victims."""
START_WORDS = ("start", "robot")
"""Words in the name on a line that mark the line as a start of the robot."""
GROUND_POSTURES: tuple[Posture, ...] = ("lying", "prone", "side")
"""Postures from which one is drawn for each person, because arena files and lists give no postures."""
MAX_LINES = 1000
"""Maximum number of lines in a list; the league's worlds have at most 20 victims."""
_SEPARATORS = re.compile(r"[\s,;:()\[\]{}=]+")


@dataclass(frozen=True)
class WorldPose:
    """The name and pose on a line of a list of placements.

    Attributes:
        name: name of the victim or start; empty if the list gives none.
        x, y, z: position, m.
        yaw: heading, rad.
    """

    name: str
    x: float
    y: float
    z: float
    yaw: float


@dataclass(frozen=True)
class Placements:
    """The victims and starts in a list of placements.

    Attributes:
        victims: poses of people.
        starts: start poses of robots.
    """

    victims: tuple[WorldPose, ...]
    starts: tuple[WorldPose, ...]

    @property
    def start(self) -> StartPose | None:
        """The first start, in the units of ``--start`` (m, m, degrees); None if the list has no start."""
        return next(((s.x, s.y, float(np.degrees(s.yaw))) for s in self.starts), None)


def is_victim(name: str) -> bool:
    """Whether the name of a model marks the model as a victim."""
    return any(word in "_".join(_words(name)) for word in VICTIM_WORDS)


def state_of(name: str) -> str:
    """The state in a victim's name, alive or dead; empty if the name contains none."""
    return next((STATE_WORDS[word] for word in reversed(_words(name)) if word in STATE_WORDS), "")


def _words(name: str) -> list[str]:
    """The words of a name in lower case; ``victimWoman_hot-2`` has the words victim, woman, hot and 2."""
    return re.findall(r"[a-z]+|\d+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower())


def read_placements(path: Path) -> Placements:
    """Read a list of placements.

    Raises:
        InputError: the file is missing, is too long or contains no poses, or a line has a wrong number of values or a
            value out of range.
    """
    lines = read_text(path).splitlines()
    if len(lines) > MAX_LINES:
        raise InputError(f"{path}: has {len(lines)} lines; the limit is {MAX_LINES}")
    poses, heading = list[WorldPose](), ""
    for number, line in enumerate(lines, 1):
        words = [word for word in _SEPARATORS.split(line.partition("#")[0]) if word]
        numbers = [value for word in words if (value := _number(word)) is not None]
        name = " ".join(word for word in words if _number(word) is None)
        if not numbers:
            heading = name or heading
        else:
            poses.append(_pose(f"{path}, line {number}", name or heading, numbers))
    if not poses:
        raise InputError(f"{path}: contains no poses; write one per line: NAME x y z roll pitch yaw, in m and rad")
    starts = tuple(pose for pose in poses if any(word in pose.name.lower() for word in START_WORDS))
    return Placements(tuple(pose for pose in poses if pose not in starts), starts)


def _number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None


def _pose(where: str, name: str, numbers: list[float]) -> WorldPose:
    if len(numbers) in (4, 7) and numbers[0] == round(numbers[0]):
        numbers = numbers[1:]  # the first number is a line number
    if len(numbers) not in (3, 6):
        raise InputError(
            f"{where}: a pose must have 3 or 6 numbers (x y z, or x y z roll pitch yaw, in m and rad),"
            f" not {len(numbers)}"
        )
    if not (np.abs(numbers) <= FARTHEST).all():  # also refuses NaN
        wrong = next(number for number in numbers if not abs(number) <= FARTHEST)
        raise InputError(f"{where}: numbers must be from -{FARTHEST:g} to {FARTHEST:g}, not {wrong:g}")
    x, y, z = numbers[:3]
    return WorldPose(name, x, y, z, numbers[5] if len(numbers) == 6 else 0.0)


def add_person(builder: ArenaBuilder, pose: WorldPose) -> None:
    """Add a person who lies with the head in the pose's +x direction.

    The number of the victim determines the person's posture and appearance.
    """
    name = builder.next_victim_name
    number = name.removeprefix(VICTIM_PREFIX)
    rng = np.random.default_rng(int(number))
    person = make_victim(number, rng, GROUND_POSTURES[int(rng.integers(len(GROUND_POSTURES)))])
    ahead, aside = person.footprint.mean(axis=0)  # the pose gives the person's centre
    cos, sin = np.cos(pose.yaw), np.sin(pose.yaw)
    middle = (pose.x - cos * ahead + sin * aside, pose.y - sin * ahead - cos * aside, pose.z)
    person.add_to(builder.root, middle, pose.yaw)
    annotate_body(builder.root, name, VICTIM, state=state_of(pose.name))
