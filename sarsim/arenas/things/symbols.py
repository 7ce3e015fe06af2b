"""Symbols of hazmat signs, drawn as filled shapes.

A drawing is a square with x to the right and y downwards, both from -1 to 1. A symbol has its own coordinates, also
from -1 to 1, which are scaled and shifted to its centre on the drawing.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont

Colour = tuple[int, int, int]
"""Red, green, blue, 0 to 255."""
FONT_SIZE = 160  # pixels, font size of a text before the text is scaled

FLAME = (
    (-0.22, 0.75), (-0.5, 0.6), (-0.68, 0.32), (-0.69, 0.04), (-0.57, -0.2), (-0.58, -0.44), (-0.44, -0.24),
    (-0.36, -0.04), (-0.3, -0.2), (-0.28, -0.45), (-0.1, -0.72), (-0.12, -1.0), (0.1, -0.82), (0.24, -0.55),
    (0.24, -0.28), (0.2, -0.1), (0.32, -0.3), (0.34, -0.54), (0.46, -0.28), (0.42, 0.02), (0.5, -0.02),
    (0.58, -0.14), (0.62, -0.36), (0.71, 0.0), (0.68, 0.32), (0.5, 0.6), (0.22, 0.75),
)  # fmt: skip
FLAME_CORE = (
    (-0.1, 0.62), (-0.2, 0.46), (-0.2, 0.24), (-0.1, 0.36), (-0.05, 0.12), (0.04, -0.1), (0.07, 0.16), (0.12, 0.34),
    (0.22, 0.2), (0.22, 0.46), (0.1, 0.62),
)  # fmt: skip
BASE = ((-0.62, 0.86), (0.62, 0.86), (0.62, 1.0), (-0.62, 1.0))
"""The line below a flame."""
JAW = ((-0.3, 0.1), (0.3, 0.1), (0.26, 0.48), (-0.26, 0.48))
NOSE = ((0.0, -0.02), (0.08, 0.14), (-0.08, 0.14))
TUBE = ((-0.5, -0.13), (0.34, -0.13), (0.5, -0.2), (0.5, 0.2), (0.34, 0.13), (-0.5, 0.13), (-0.6, 0.0))
DROP = ((0.0, -0.14), (0.06, 0.0), (0.04, 0.07), (-0.04, 0.07), (-0.06, 0.0))
METAL = ((-1.0, 0.62), (-0.72, 0.62), (-0.62, 0.74), (-0.5, 0.62), (-0.16, 0.62), (-0.16, 0.8), (-1.0, 0.8))
HAND = (
    (0.06, 0.78), (0.16, 0.62), (0.36, 0.56), (0.42, 0.66), (0.56, 0.58), (0.78, 0.56), (1.04, 0.6), (1.04, 0.88),
    (0.7, 0.9), (0.4, 0.9), (0.16, 0.86),
)  # fmt: skip
CYLINDER = (
    (-1.0, -0.16), (-0.94, -0.2), (0.42, -0.2), (0.56, -0.08), (0.66, -0.08), (0.66, -0.13), (0.92, -0.13),
    (0.96, -0.07), (0.96, 0.07), (0.92, 0.13), (0.66, 0.13), (0.66, 0.08), (0.56, 0.08), (0.42, 0.2), (-0.94, 0.2),
    (-1.0, 0.16),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Drawing:
    """A picture on which shapes are drawn.

    Attributes:
        pixels: (N, N, 3) uint8 RGB.
    """

    pixels: NDArray[np.uint8]

    @classmethod
    def blank(cls, size: int, colour: Colour) -> "Drawing":
        """A drawing of ``size`` × ``size`` pixels in one colour."""
        return cls(np.full((size, size, 3), colour, np.uint8))

    def polygon(self, corners: ArrayLike, colour: Colour) -> None:
        """Fill a polygon with corners (N, 2)."""
        cv2.fillPoly(self.pixels, [self._places(corners)], colour, cv2.LINE_AA)

    def line(self, corners: ArrayLike, width: float, colour: Colour, closed: bool = False) -> None:
        """Draw a line of the given width through corners (N, 2)."""
        cv2.polylines(self.pixels, [self._places(corners)], closed, colour, self._length(width), cv2.LINE_AA)

    def disc(self, centre: ArrayLike, radius: float, colour: Colour) -> None:
        """Fill a circle."""
        (place,) = self._places(np.asarray(centre)[None])
        cv2.circle(self.pixels, place.tolist(), self._length(radius), colour, cv2.FILLED, cv2.LINE_AA)

    def ring(self, centre: ArrayLike, radius: float, width: float, colour: Colour) -> None:
        """Draw a circle with a line of the given width."""
        (place,) = self._places(np.asarray(centre)[None])
        cv2.circle(self.pixels, place.tolist(), self._length(radius), colour, self._length(width), cv2.LINE_AA)

    def text(self, text: str, centre: ArrayLike, size: tuple[float, float], bold: float, colour: Colour) -> None:
        """Write a text with the height, and at most the width, in ``size`` (width, height).

        ``bold``: ratio of the stroke's width to the height of the letters.
        """
        letters = _letters(text, bold)
        height = self._length(size[1])
        width = min(round(letters.shape[1] * height / letters.shape[0]), self._length(size[0]))
        ink = cv2.resize(letters, (max(width, 1), height), interpolation=cv2.INTER_AREA)[..., None] / 255.0
        left, top = self._places(np.asarray(centre)[None])[0] - np.array([width, height]) // 2
        place = self.pixels[top : top + height, left : left + width]
        place[:] = np.rint(place * (1 - ink) + np.array(colour) * ink)

    def _length(self, length: float) -> int:
        return max(1, round(length * len(self.pixels) / 2))

    def _places(self, points: ArrayLike) -> NDArray[np.int32]:
        """(N, 2) int32 pixel coordinates of points (N, 2)."""
        return np.rint((np.asarray(points, np.float64) + 1) / 2 * len(self.pixels) - 0.5).astype(np.int32)


@dataclass(frozen=True, eq=False)
class Symbol:
    """The place and colours of a symbol on a drawing, and methods that draw each symbol there.

    Attributes:
        drawing: the drawing to which the symbol is added.
        centre: (2,) centre of the symbol on the drawing.
        scale: half size of the symbol on the drawing.
        ink: colour of the symbol.
        background: background colour.
    """

    drawing: Drawing
    centre: tuple[float, float]
    scale: float
    ink: Colour
    background: Colour

    def flame(self) -> None:
        """Draw a flame above a line."""
        self._polygon(FLAME, self.ink)
        self._polygon(FLAME_CORE, self.background)
        self._polygon(BASE, self.ink)

    def flame_over_circle(self) -> None:
        """Draw a flame on a ring above a line, the symbol of oxidisers."""
        self._polygon(np.array(FLAME) * 0.62 + [0.0, -0.4], self.ink)
        self.drawing.disc(self._at((0, 0.38)), 0.42 * self.scale, self.ink)
        self.drawing.disc(self._at((0, 0.38)), 0.31 * self.scale, self.background)
        self._polygon(BASE, self.ink)

    def skull(self) -> None:
        """Draw a skull and crossbones, outlined in ink and filled with the background colour."""
        for end in ((0.85, 0.9), (0.85, 0.2)):
            for width, colour in ((0.24, self.ink), (0.14, self.background)):
                self._bone(np.array([end, (-end[0], 1.1 - end[1])]), width, colour)
        for grown, colour in ((1.0, self.ink), (0.9, self.background)):
            self.drawing.disc(self._at((0, -0.3)), 0.56 * grown * self.scale, colour)
            self._polygon(np.array(JAW) * [grown, grown**0.5], colour)
        for x in (-0.22, 0.22):
            self.drawing.disc(self._at((x, -0.2)), 0.15 * self.scale, self.ink)
        self._polygon(NOSE, self.ink)
        for x in (-0.16, 0.0, 0.16):
            self._line([(x, 0.26), (x, 0.46)], 0.04, self.ink)

    def trefoil(self) -> None:
        """Draw three blades around a disc, the symbol of radiation."""
        for middle in (30, 150, 270):
            angles = np.radians(np.arange(middle - 30, middle + 31, 5))
            rim = np.column_stack([np.cos(angles), -np.sin(angles)])
            self._polygon(np.concatenate([rim, 0.3 * rim[::-1]]), self.ink)
        self.drawing.disc(self._at((0, 0)), 0.2 * self.scale, self.ink)

    def biohazard(self) -> None:
        """Draw three open crescents on a ring, the symbol of infectious substances."""
        ways = [np.array([np.cos(a), -np.sin(a)]) for a in np.radians((90, 210, 330))]
        for shift, radius, colour in ((0.44, 0.5, self.ink), (0.56, 0.4, self.background)):
            for way in ways:
                self.drawing.disc(self._at(shift * way), radius * self.scale, colour)
        for way in ways:
            self._line([0.7 * way, 1.1 * way], 0.2, self.background)
            self._line([0.0 * way, 0.2 * way], 0.06, self.background)
        self.drawing.ring(self._at((0, 0)), 0.5 * self.scale, 0.1 * self.scale, self.ink)
        self.drawing.disc(self._at((0, 0)), 0.12 * self.scale, self.background)

    def corrosion(self) -> None:
        """Draw two test tubes with drops that corrode a piece of metal and a hand."""
        for x, turn in ((-0.42, 0.3), (0.42, np.pi - 0.3)):
            cos, sin = np.cos(turn), np.sin(turn)
            tube = 0.7 * np.array(TUBE) @ np.array([(cos, sin), (-sin, cos)])
            self._polygon(tube + np.array([x, -0.35]), self.ink)
            self._polygon(tube * [0.88, 0.6] + np.array([x, -0.35]), self.background)
        for x, y in ((-0.1, 0.05), (-0.55, 0.28), (-0.3, 0.4), (0.12, 0.05), (0.5, 0.3), (0.66, 0.42)):
            self._polygon(np.array(DROP) + np.array([x, y]), self.ink)
        self._polygon(METAL, self.ink)
        self._polygon(HAND, self.ink)
        for x in (0.62, 0.78, 0.94):
            self._line([(x, 0.66), (x + 0.1, 0.8)], 0.03, self.background)

    def gas_cylinder(self) -> None:
        """Draw a tilted gas cylinder."""
        self._polygon(np.array(CYLINDER) @ np.array([(0.97, -0.22), (0.22, 0.97)]), self.ink)

    def bomb(self) -> None:
        """Draw a bursting round bomb, the symbol of explosives."""
        self.drawing.disc(self._at((0, 0.35)), 0.42 * self.scale, self.ink)
        for way in np.radians(np.arange(0, 181, 22.5)):
            tip = np.array([np.cos(way), -np.sin(way)])
            self._line([0.5 * tip + np.array([0, 0.3]), tip + np.array([0, 0.25])], 0.09, self.ink)
        self._polygon(np.array(BASE) + np.array([0.0, 0.05]), self.ink)

    def _bone(self, ends: NDArray[np.float64], width: float, colour: Colour) -> None:
        self._line(ends, width * 0.7, colour)
        for end in ends:
            for side in (-1, 1):
                self.drawing.disc(self._at(end + np.array([0, 0.08 * side])), width / 2 * self.scale, colour)

    def _at(self, points: ArrayLike) -> NDArray[np.float64]:
        return np.asarray(points, np.float64) * self.scale + self.centre

    def _polygon(self, corners: ArrayLike, colour: Colour) -> None:
        self.drawing.polygon(self._at(corners), colour)

    def _line(self, corners: ArrayLike | Sequence[NDArray[np.float64]], width: float, colour: Colour) -> None:
        self.drawing.line(self._at(np.asarray(corners)), width * self.scale, colour)


def _letters(text: str, bold: float) -> NDArray[np.uint8]:
    """(H, W) uint8 image of a text, white on black, cropped to its bounding box."""
    font, stroke = ImageFont.load_default(FONT_SIZE), round(bold * FONT_SIZE)
    left, top, right, bottom = (round(edge) for edge in font.getbbox(text, stroke_width=stroke))
    image = Image.new("L", (right - left, bottom - top))
    ImageDraw.Draw(image).text((-left, -top), text, 255, font, stroke_width=stroke)
    return np.asarray(image)
