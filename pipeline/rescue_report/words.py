"""Format numbers for readers; each function is also a template filter."""

import re

import numpy as np
from numpy.typing import ArrayLike

from pipeline.transforms import wrap_angle

LEVEL = np.deg2rad(4)
"""Maximum inclination of ground that is described as level, rad."""
STRAIGHT = np.deg2rad(20)
"""Maximum angle from straight ahead or straight behind at which a direction is described as such, rad."""


def number(value: float, digits: int = 1) -> str:
    """A number with ``digits`` decimal places, a true minus sign and no negative zero."""
    text = f"{value:.{digits}f}"
    return text.lstrip("-") if float(text) == 0 else text.replace("-", "−")


def metres(value: float, digits: int = 1) -> str:
    """A length, given in m, with its unit."""
    return f"{number(value, digits)} m"


def centimetres(value: float) -> str:
    """A height, given in m, in whole cm."""
    return f"{number(100 * value, 0)} cm"


def degrees(angle: float) -> str:
    """An angle, given in rad, in whole degrees."""
    return f"{number(np.degrees(angle), 0)}°"


def percent(fraction: float) -> str:
    """A fraction in whole percent; 100% only for a fraction of 1."""
    whole = f"{fraction:.0%}"
    return "99%" if fraction < 1 and whole == "100%" else whole


def place(position: ArrayLike) -> str:
    """Coordinates, given in m, in parentheses and with their unit."""
    return "(" + ", ".join(number(value) for value in np.asarray(position)) + ") m"


def minutes(seconds: float) -> str:
    """A duration, given in s, in minutes and seconds."""
    whole, rest = divmod(round(seconds), 60)
    return f"{whole} min {rest:02d} s" if whole else f"{rest} s"


def counted(count: int, one: str, many: str = "") -> str:
    """A number with its noun: ``counted(2, "drop")`` returns "2 drops"."""
    return f"{count or 'no'} {one if count == 1 else many or one + 's'}"


def breakable(text: str) -> str:
    """HTML of an escaped name or value, with line breaks allowed between its parts but never in a word or number."""
    return re.sub(r"(?<=[_/:])(?=\w)|(?<=\.)(?=[^\W\d])", "<wbr>", str(text))


def slope(angle: float) -> str:
    """The steepness of a path in words, given its maximum inclination, rad."""
    return f"steepest ground {degrees(angle)}" if angle >= LEVEL else "level ground"


def side(angle: float) -> str:
    """A direction ``angle`` rad to the left of straight ahead, in words."""
    angle = wrap_angle(angle)
    if abs(angle) <= STRAIGHT:
        return "straight ahead"
    if abs(angle) >= np.pi - STRAIGHT:
        return "behind"
    return f"{degrees(abs(angle))} to the {'left' if angle > 0 else 'right'}"


def turn(angle: float) -> str:
    """The instruction to turn by ``angle`` rad to the left."""
    angle = wrap_angle(angle)
    if abs(angle) <= STRAIGHT:
        return "straight on"
    if abs(angle) >= np.pi - STRAIGHT:
        return "turn around"
    how = "turn" if abs(angle) >= np.pi / 4 else "bear"
    return f"{how} {'left' if angle > 0 else 'right'} by {5 * round(np.degrees(abs(angle)) / 5)}°"


def rotate(angle: float) -> str:
    """The SVG transform that turns a symbol, which points right, by ``angle`` rad counter-clockwise."""
    return f"rotate({-np.degrees(angle):.0f})"


FILTERS = (
    *(breakable, centimetres, counted, degrees, metres, minutes, number, percent, place),
    *(rotate, side, slope, turn),
)
