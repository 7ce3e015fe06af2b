"""Hazmat labels as varied as those of many printers; the sign classifier learns from them and the arenas' labels.

A label is a square that stands on a corner. It is drawn in its own frame, x to the right and y down, with corners at
(0, ±1) and (±1, 0). The classes are from the UN's Model Regulations, and the words are those that rescue teams use.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont

from pipeline.finds.hazmat_classes import HAZMAT_CLASSES

Colour = tuple[int, int, int]
WHITE, BLACK = (250, 250, 250), (15, 15, 15)
RED, GREEN, BLUE, YELLOW, ORANGE = (218, 40, 30), (0, 122, 82), (0, 76, 170), (255, 215, 0), (255, 130, 50)
FLAME = (
    (0, -0.5), (0.13, -0.3), (0.1, -0.12), (0.22, -0.28), (0.34, 0.02), (0.42, -0.1), (0.38, 0.28), (0.2, 0.46),
    (0.12, 0.24), (0.02, 0.06), (-0.06, 0.3), (-0.2, 0.46), (-0.38, 0.26), (-0.42, 0), (-0.3, 0.1), (-0.26, -0.2),
    (-0.14, -0.06), (-0.06, -0.26),
)  # fmt: skip
SUPERSAMPLING = 2  # Ratio of the drawn to the requested number of pixels along a side


@dataclass(frozen=True)
class LabelDesign:
    """The features that distinguish a class.

    Attributes:
        upper, lower: background colours of the two halves.
        picture: name of the pictogram, "" for none.
        words: alternative texts, of which one is printed; newlines separate lines.
        number: number of the UN class, at the lower corner.
        stripes: whether the label has red stripes.
    """

    upper: Colour
    lower: Colour
    picture: str
    words: tuple[str, ...]
    number: str
    stripes: bool = False


DESIGNS: dict[str, LabelDesign] = {
    "corrosive": LabelDesign(WHITE, BLACK, "corrosion", ("CORROSIVE",), "8"),
    "dangerous-when-wet": LabelDesign(BLUE, BLUE, "flame", ("DANGEROUS\nWHEN WET", "DANGEROUS WHEN WET"), "4"),
    "explosive": LabelDesign(ORANGE, ORANGE, "1.4", ("EXPLOSIVE", "EXPLOSIVES"), "1"),
    "flammable": LabelDesign(RED, RED, "flame", ("FLAMMABLE",), "3"),
    "flammable-gas": LabelDesign(RED, RED, "flame", ("FLAMMABLE\nGAS", "FLAMMABLE GAS"), "2"),
    "flammable-liquid": LabelDesign(RED, RED, "flame", ("FLAMMABLE\nLIQUID", "FLAMMABLE LIQUID"), "3"),
    "flammable-solid": LabelDesign(WHITE, WHITE, "flame", ("FLAMMABLE\nSOLID", "FLAMMABLE SOLID"), "4", stripes=True),
    "infectious-substance": LabelDesign(WHITE, WHITE, "biohazard", ("INFECTIOUS\nSUBSTANCE",), "6"),
    "inhalation-hazard": LabelDesign(WHITE, WHITE, "dark skull", ("INHALATION\nHAZARD",), "6"),
    "non-flammable-gas": LabelDesign(GREEN, GREEN, "cylinder", ("NON-FLAMMABLE\nGAS", "NON-FLAMMABLE GAS"), "2"),
    "organic-peroxide": LabelDesign(RED, YELLOW, "flame", ("ORGANIC\nPEROXIDE", "ORGANIC PEROXIDE"), "5.2"),
    "oxidizer": LabelDesign(YELLOW, YELLOW, "burning circle", ("OXIDIZER", "OXIDIZING\nAGENT"), "5.1"),
    "oxygen": LabelDesign(YELLOW, YELLOW, "burning circle", ("OXYGEN",), "2"),
    "poison": LabelDesign(WHITE, WHITE, "skull", ("POISON", "TOXIC"), "6"),
    "radioactive": LabelDesign(YELLOW, WHITE, "trefoil", ("RADIOACTIVE", "RADIOACTIVE II"), "7"),
    "spontaneously-combustible": LabelDesign(WHITE, RED, "flame", ("SPONTANEOUSLY\nCOMBUSTIBLE",), "4"),
}  # fmt: skip
assert tuple(DESIGNS) == HAZMAT_CLASSES


class Sheet:
    """A square image on which to draw in a label's own frame."""

    def __init__(self, pixels: int):
        """A white sheet, ``pixels`` wide."""
        self.image = Image.new("RGB", (pixels, pixels), WHITE)
        self._draw, self._half = ImageDraw.Draw(self.image), pixels / 2

    def _at(self, points: ArrayLike) -> list[tuple[float, float]]:
        return [tuple(p) for p in ((np.asarray(points, np.float64) + 1) * self._half).tolist()]

    def polygon(self, points: ArrayLike, colour: Colour) -> None:
        """Fill a polygon of (N, 2) points."""
        self._draw.polygon(self._at(points), fill=colour)

    def line(self, points: ArrayLike, colour: Colour, width: float) -> None:
        """Draw a line of width ``width`` through (N, 2) points."""
        self._draw.line(self._at(points), fill=colour, width=max(1, round(width * self._half)), joint="curve")

    def circle(self, middle: ArrayLike, radius: float, colour: Colour, width: float = 0.0) -> None:
        """Draw a disc or, if ``width`` is given, a circle with a line of this width."""
        low, high = self._at(np.asarray(middle) + np.array([[-radius], [radius]]))
        if width:
            self._draw.ellipse([low, high], outline=colour, width=max(1, round(width * self._half)))
        else:
            self._draw.ellipse([low, high], fill=colour)

    def text(self, middle: tuple[float, float], text: str, width: float, height: float, colour: Colour) -> None:
        """Draw a line of text, compressed or stretched to fill a box."""
        font = ImageFont.load_default(size=round(self._half / 2))
        left, top, right, bottom = font.getbbox(text)
        mask = Image.new("L", (max(1, round(right - left)), max(1, round(bottom - top))))
        ImageDraw.Draw(mask).text((-left, -top), text, fill=255, font=font, stroke_width=2)
        size = max(1, round(width * self._half)), max(1, round(height * self._half))
        corner = (np.array(middle) + 1) * self._half - np.array(size) / 2
        self.image.paste(colour, tuple(np.round(corner).astype(int).tolist()), mask.resize(size))


def diamond(radius: float, middle: ArrayLike = (0, 0)) -> NDArray[np.float64]:
    """(4, 2) corners of a square that stands on a corner: top, right, bottom, left."""
    return np.array([[0, -1], [1, 0], [0, 1], [-1, 0]]) * radius + np.asarray(middle)


def _flame(sheet: Sheet, at: NDArray[np.float64], size: float, ink: Colour, ground: Colour) -> None:
    sheet.polygon(np.array(FLAME) * size + at, ink)
    sheet.line(at + np.array([[-0.4, 0.56], [0.4, 0.56]]) * size, ink, 0.1 * size)


def _burning_circle(sheet: Sheet, at: NDArray[np.float64], size: float, ink: Colour, ground: Colour) -> None:
    below = at + np.array([0, 0.22 * size])
    sheet.polygon(np.array(FLAME) * 0.75 * size + at - (0, 0.16 * size), ink)
    sheet.circle(below, 0.25 * size, ground)
    sheet.circle(below, 0.27 * size, ink, 0.08 * size)
    sheet.line(at + np.array([[-0.4, 0.56], [0.4, 0.56]]) * size, ink, 0.1 * size)


def _skull(sheet: Sheet, at: NDArray[np.float64], size: float, ink: Colour, ground: Colour) -> None:
    for sign in (-1, 1):
        sheet.line(at + np.array([[-0.45 * sign, 0.2], [0.45 * sign, 0.5]]) * size, ink, 0.1 * size)
    sheet.circle(at - (0, 0.12 * size), 0.32 * size, ink)
    sheet.polygon(at + np.array([[-0.18, 0.1], [0.18, 0.1], [0.16, 0.34], [-0.16, 0.34]]) * size, ink)
    for x in (-0.13, 0.13):
        sheet.circle(at + np.array([x, -0.08]) * size, 0.09 * size, ground)


def _dark_skull(sheet: Sheet, at: NDArray[np.float64], size: float, ink: Colour, ground: Colour) -> None:
    sheet.polygon(diamond(0.62 * size, at), BLACK)
    _skull(sheet, at, 0.62 * size, WHITE, BLACK)


def _trefoil(sheet: Sheet, at: NDArray[np.float64], size: float, ink: Colour, ground: Colour) -> None:
    for middle in np.deg2rad([-30, 90, 210]) + np.pi:
        angles = middle + np.deg2rad(np.linspace(-30, 30, 9))
        rim = np.column_stack([np.cos(angles), np.sin(angles)]) * size
        sheet.polygon(np.concatenate([0.5 * rim, 0.16 * rim[::-1]]) + at, ink)
    sheet.circle(at, 0.1 * size, ink)


def _biohazard(sheet: Sheet, at: NDArray[np.float64], size: float, ink: Colour, ground: Colour) -> None:
    ways = [np.array([np.cos(a), np.sin(a)]) for a in np.deg2rad([-90, 30, 150])]
    for way in ways:
        sheet.circle(at + 0.25 * size * way, 0.29 * size, ink)
    for way in ways:
        sheet.circle(at + 0.34 * size * way, 0.21 * size, ground)
    sheet.circle(at, 0.26 * size, ink, 0.07 * size)
    sheet.circle(at, 0.07 * size, ground)


def _cylinder(sheet: Sheet, at: NDArray[np.float64], size: float, ink: Colour, ground: Colour) -> None:
    turn = np.deg2rad(-15)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    outline = [
        [-0.5, -0.14],
        [0.3, -0.14],
        [0.38, -0.06],
        [0.55, -0.06],
        [0.55, 0.06],
        [0.38, 0.06],
        [0.3, 0.14],
        [-0.5, 0.14],
    ]
    sheet.polygon(np.array(outline) @ R.T * size + at, ink)


def _corrosion(sheet: Sheet, at: NDArray[np.float64], size: float, ink: Colour, ground: Colour) -> None:
    for sign in (-1, 1):
        tube = np.array([[0.06, -0.36], [0.5, -0.5], [0.54, -0.38], [0.1, -0.24]]) * (sign, 1)
        sheet.line(np.concatenate([tube, tube[:1]]) * size + at, ink, 0.04 * size)
        for drop in ((0.12, -0.1), (0.2, 0.02), (0.08, 0.1)):
            sheet.circle(at + np.array(drop) * (sign, 1) * size, 0.04 * size, ink)
    sheet.polygon(at + np.array([[-0.62, 0.2], [-0.08, 0.2], [-0.08, 0.32], [-0.62, 0.32]]) * size, ink)
    sheet.polygon(at + np.array([[0.08, 0.2], [0.45, 0.14], [0.62, 0.2], [0.6, 0.34], [0.2, 0.32]]) * size, ink)


def _burst(sheet: Sheet, at: NDArray[np.float64], size: float, ink: Colour, ground: Colour) -> None:
    angles = np.linspace(0, 2 * np.pi, 25)[:-1]
    radius = np.where(np.arange(24) % 2, 0.18, 0.5) * size
    sheet.polygon(np.column_stack([np.cos(angles), np.sin(angles)]) * radius[:, None] + at, ink)


def _division(sheet: Sheet, at: NDArray[np.float64], size: float, ink: Colour, ground: Colour) -> None:
    sheet.text((float(at[0]), float(at[1])), "1.4", size, 0.55 * size, ink)


PICTURES: dict[str, Callable[[Sheet, NDArray[np.float64], float, Colour, Colour], None]] = {
    "flame": _flame, "burning circle": _burning_circle, "skull": _skull, "dark skull": _dark_skull,
    "trefoil": _trefoil, "biohazard": _biohazard, "cylinder": _cylinder, "corrosion": _corrosion, "burst": _burst,
    "1.4": _division,
}  # fmt: skip


def draw_varied(name: str, pixels: int, rng: np.random.Generator) -> NDArray[np.uint8]:
    """A label of a class as a random printer might print it, on white, (pixels, pixels, 3) uint8."""
    design, sheet = DESIGNS[name], Sheet(SUPERSAMPLING * pixels)
    upper, lower = (_varied(colour, rng) for colour in (design.upper, design.lower))
    lower = upper if design.upper == design.lower else lower
    edge = 1 - rng.choice([0.0, rng.uniform(0.02, 0.1)])
    sheet.polygon(diamond(edge), upper)
    horizon = rng.uniform(-0.05, 0.1)
    below = np.array(
        [[horizon - edge, horizon], [edge - horizon, horizon], [0, edge]] if horizon > 0 else diamond(edge)[1:]
    )
    sheet.polygon(below, lower)
    if design.stripes:
        _stripes(sheet, edge, rng)
    light = sum(design.upper) > sum(GREEN) + 200
    ink = BLACK if light else (WHITE if rng.random() < 0.75 else BLACK)
    if rng.random() < 0.85:
        inset = edge - rng.uniform(0.04, 0.12)
        ring = diamond(inset)
        sheet.line(np.concatenate([ring, ring[:2]]), ink, rng.uniform(0.008, 0.025))
    picture = "burst" if design.picture == "1.4" and rng.random() < 0.3 else design.picture
    size = rng.uniform(0.42, 0.62)
    at = np.array([rng.uniform(-0.04, 0.04), rng.uniform(-0.55, -0.4)])
    PICTURES[picture](sheet, at, size, ink, upper)
    _print_words(sheet, design, ink, lower, rng)
    return np.asarray(sheet.image.resize((pixels, pixels), Image.Resampling.BOX))


def _print_words(sheet: Sheet, design: LabelDesign, ink: Colour, lower: Colour, rng: np.random.Generator) -> None:
    """Usually print the name across the middle, and the class number at the lower corner."""
    dark = sum(lower) < sum(WHITE) / 3
    below = WHITE if dark or ink == WHITE else BLACK
    if rng.random() < 0.92:
        lines = design.words[rng.integers(len(design.words))].split("\n")
        height = rng.uniform(0.13, 0.24) / len(lines) ** 0.5
        top = rng.uniform(-0.08, 0.08) - height * (len(lines) - 1) / 2
        for k, line in enumerate(lines):
            y = top + k * height * 1.15
            room = 2 * (0.86 - abs(y) - height / 2)
            width = min(room, rng.uniform(0.5, 0.95) * height * len(line))
            colour = below if y > 0.05 and design.upper != design.lower else (WHITE if ink == WHITE else BLACK)
            sheet.text((0, y), line, width, height, colour)
    if rng.random() < 0.92:
        height = rng.uniform(0.14, 0.24)
        sheet.text((0, rng.uniform(0.5, 0.68)), design.number, 0.6 * height * len(design.number), height, below)


def _stripes(sheet: Sheet, edge: float, rng: np.random.Generator) -> None:
    """Draw seven vertical red stripes."""
    red, width = _varied(RED, rng), 2 * edge / 13
    for k in range(-3, 4):
        low, high = 2 * k * width - width / 2, 2 * k * width + width / 2
        tops = [edge - abs(low), edge - abs(high)]
        points = [[low, -tops[0]], *([[0, -edge]] if k == 0 else []), [high, -tops[1]], [high, tops[1]]]
        sheet.polygon([*points, *([[0, edge]] if k == 0 else []), [low, tops[0]]], red)


def _varied(colour: Sequence[int], rng: np.random.Generator) -> Colour:
    """A colour as another printer might print it."""
    r, g, b = np.clip(np.array(colour) + rng.normal(0, 14, 3), 0, 255).astype(int).tolist()
    return r, g, b
