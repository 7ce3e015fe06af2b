"""Draws hazmat signs as teams print them: a coloured diamond with a symbol, words and a class number.

Colours, symbols and class numbers follow the placards of 49 CFR 172.500 and the UN model regulations.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from sarsim.arenas.things.symbols import Colour, Drawing, Symbol

BLACK, WHITE = (0, 0, 0), (255, 255, 255)
RED, ORANGE, YELLOW = (218, 41, 28), (255, 134, 54), (255, 221, 0)
GREEN, BLUE = (0, 122, 82), (0, 87, 184)
SUPERSAMPLING = 2  # Supersampling factor of drawings
BLEED = 1.5  # Ratio of the width of the coloured areas to the diagonal of the diamond that is cut from them
LINE_RATIO = 0.92  # Ratio of the inner line's diagonal to the sign's diagonal


@dataclass(frozen=True)
class SignStyle:
    """The print style of a sign; the default is the plain placard.

    Attributes:
        has_line: whether the sign has the inner line.
        has_words: whether the sign has words below the symbol.
        has_number: whether the sign has its class number.
        bold: thickness added to letters, as a fraction of their height.
        max_letter_width: maximum mean width of letters, as a fraction of their height.
        size: ratio of the symbol's size to its size on the placard.
        tint: factors, due to ink and paper, by which red, green and blue are multiplied.
        variant: index of the variant, 0 to 3, for signs with several variants.
    """

    has_line: bool = True
    has_words: bool = True
    has_number: bool = True
    bold: float = 0.045
    max_letter_width: float = 0.72
    size: float = 1.0
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    variant: int = 0

    @classmethod
    def random(cls, rng: np.random.Generator) -> Self:
        """A random style of the kind that teams print."""
        return cls(
            has_line=bool(rng.random() < 0.8),
            has_words=bool(rng.random() < 0.9),
            has_number=bool(rng.random() < 0.95),
            bold=float(rng.uniform(0.015, 0.06)),
            max_letter_width=float(rng.uniform(0.62, 0.95)),
            size=float(rng.uniform(0.9, 1.12)),
            tint=(float(rng.uniform(0.82, 1.0)), float(rng.uniform(0.82, 1.0)), float(rng.uniform(0.82, 1.0))),
            variant=int(rng.integers(4)),
        )


@dataclass(frozen=True)
class _Sign:
    """The contents of a sign.

    Attributes:
        top, bottom: colours of the parts above and below ``split``.
        symbol: function that draws the symbol.
        words: lines of text.
        number: class number.
        ink: colour of symbol and words.
        number_colour: colour of the number.
        split: y of the edge between the two parts, from -1 at the top of the drawing to 1 at the bottom.
    """

    top: Colour
    bottom: Colour
    symbol: Callable[[Symbol], None]
    words: tuple[str, ...]
    number: str
    ink: Colour = BLACK
    number_colour: Colour = BLACK
    split: float = 0.0


_SIGNS = {
    "corrosive": _Sign(WHITE, BLACK, Symbol.corrosion, ("CORROSIVE",), "8", BLACK, WHITE, -0.2),
    "dangerous-when-wet": _Sign(BLUE, BLUE, Symbol.flame, ("DANGEROUS", "WHEN WET"), "4", WHITE, WHITE),
    "explosive": _Sign(ORANGE, ORANGE, Symbol.bomb, ("EXPLOSIVE",), "1"),
    "flammable": _Sign(RED, RED, Symbol.flame, ("FLAMMABLE",), "3", WHITE, WHITE),
    "flammable-gas": _Sign(RED, RED, Symbol.flame, ("FLAMMABLE", "GAS"), "2", WHITE, WHITE),
    "flammable-liquid": _Sign(RED, RED, Symbol.flame, ("FLAMMABLE", "LIQUID"), "3", WHITE, WHITE),
    "flammable-solid": _Sign(WHITE, WHITE, Symbol.flame, ("FLAMMABLE", "SOLID"), "4"),
    "infectious-substance": _Sign(WHITE, WHITE, Symbol.biohazard, ("INFECTIOUS", "SUBSTANCE"), "6"),
    "inhalation-hazard": _Sign(WHITE, WHITE, Symbol.skull, ("INHALATION", "HAZARD"), "6"),
    "non-flammable-gas": _Sign(GREEN, GREEN, Symbol.gas_cylinder, ("NON-FLAMMABLE", "GAS"), "2", WHITE, WHITE),
    "organic-peroxide": _Sign(RED, YELLOW, Symbol.flame, ("ORGANIC", "PEROXIDE"), "5.2"),
    "oxidizer": _Sign(YELLOW, YELLOW, Symbol.flame_over_circle, ("OXIDIZER",), "5.1"),
    "oxygen": _Sign(YELLOW, YELLOW, Symbol.flame_over_circle, ("OXYGEN",), "2"),
    "poison": _Sign(WHITE, WHITE, Symbol.skull, ("POISON",), "6"),
    "radioactive": _Sign(YELLOW, WHITE, Symbol.trefoil, ("RADIOACTIVE",), "7", split=-0.15),
    "spontaneously-combustible": _Sign(WHITE, RED, Symbol.flame, ("SPONTANEOUSLY", "COMBUSTIBLE"), "4"),
}
"""Signs by the class names that teams report, :data:`pipeline.tracks.find.HAZMAT_CLASSES`."""


def sign_face(name: str, size: int = 512, style: SignStyle | None = None) -> NDArray[np.uint8]:
    """(size, size, 3) uint8 RGB, the sign of a class as a square; the diamond's top corner is at the top left."""
    upright = _draw_sign(name, round(SUPERSAMPLING * size * np.sqrt(2)), style or SignStyle())
    # The diamond's top, right, bottom and left corners become the square's corners, clockwise from the top left.
    far, half = len(upright) - 1.0, (len(upright) - 1) / 2
    corners = np.array([(half, 0), (far, half), (half, far), (0, half)], np.float32)
    square = (SUPERSAMPLING * size - 1.0) * np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    M = cv2.getPerspectiveTransform(corners, square)
    face = cv2.warpPerspective(
        upright, M, (SUPERSAMPLING * size,) * 2, flags=cv2.INTER_AREA, borderMode=cv2.BORDER_REPLICATE
    )
    return cv2.resize(face, (size, size), interpolation=cv2.INTER_AREA).astype(np.uint8)


def _draw_sign(name: str, size: int, style: SignStyle) -> NDArray[np.uint8]:
    """(size, size, 3) uint8 RGB, a sign that stands on its corner; its colours extend beyond the diamond's edges."""
    sign = _SIGNS[name]
    drawing = Drawing.blank(size, sign.top)
    drawing.polygon([(-BLEED, sign.split), (BLEED, sign.split), (BLEED, BLEED), (-BLEED, BLEED)], sign.bottom)
    if name == "flammable-solid":
        _draw_stripes(drawing)
    if name == "inhalation-hazard":
        drawing.polygon(_diamond(0.36, (0, -0.5)), BLACK)
    _draw_margin(drawing, sign, style)
    _draw_symbol(drawing, name, sign, style)
    if style.has_words:
        _draw_words(drawing, sign, style)
    if style.has_number:
        drawing.text(sign.number, (0, 0.64), (0.5, 0.22), style.bold, sign.number_colour)
    return np.rint(drawing.pixels * np.array(style.tint)).astype(np.uint8)


def _diamond(half: float, centre: tuple[float, float] = (0.0, 0.0)) -> NDArray[np.float64]:
    """(4, 2) corners of a diamond with half diagonal ``half``."""
    return half * np.array([(0, -1), (1, 0), (0, 1), (-1, 0)], np.float64) + centre


def _draw_stripes(drawing: Drawing) -> None:
    """Draw seven vertical red stripes."""
    for x in np.arange(-6, 7, 2) / 7.5:
        drawing.polygon([(x - 0.07, -1), (x + 0.07, -1), (x + 0.07, 1), (x - 0.07, 1)], RED)


def _draw_margin(drawing: Drawing, sign: _Sign, style: SignStyle) -> None:
    """Draw the inner line and, in some variants of signs with a white part, a white margin outside it."""
    if WHITE in (sign.top, sign.bottom) and sign.bottom in (WHITE, BLACK) and not style.variant % 2:
        ring = (1 + LINE_RATIO) / 2
        drawing.line(_diamond(ring), 1 - LINE_RATIO, WHITE, closed=True)
    if style.has_line:
        for half, colour in (
            (_diamond(LINE_RATIO)[[3, 0, 1]], sign.ink),
            (_diamond(LINE_RATIO)[[1, 2, 3]], sign.number_colour),
        ):
            on_black = colour == WHITE and sign.bottom == BLACK
            drawing.line(half, 0.012, BLACK if on_black else colour)


def _draw_symbol(drawing: Drawing, name: str, sign: _Sign, style: SignStyle) -> None:
    if name == "explosive" and style.variant != 3:
        # Divisions 1.4 to 1.6 have their number and the letter of their compatibility group instead of the bomb.
        drawing.text(("1.4", "1.4", "1.5")[style.variant], (0, -0.36), (0.9, 0.42), 2 * style.bold, BLACK)
        drawing.text(("E", "S", "D")[style.variant], (0, 0.4), (0.3, 0.18), style.bold, BLACK)
        return
    small = name == "inhalation-hazard"
    scale = (0.2 if small else 0.29) * style.size * (1.35 if name in ("corrosive", "non-flammable-gas") else 1)
    colours = (WHITE, BLACK) if small else (sign.ink, sign.top)
    sign.symbol(Symbol(drawing, (0.0, -0.5), scale, *colours))


def _draw_words(drawing: Drawing, sign: _Sign, style: SignStyle) -> None:
    """Draw the lines of text in the middle of the sign; no line is wider than the diamond allows."""
    height = 0.26 if len(sign.words) == 1 else 0.2
    for line, text in enumerate(sign.words):
        y = 0.06 + (line - (len(sign.words) - 1) / 2) * height * 1.2 + (0.1 if sign.bottom == BLACK else 0.0)
        room = 1.75 * (0.97 - abs(y) - height / 2)
        width = min(room, len(text) * height * style.max_letter_width)
        colour = sign.number_colour if y > sign.split and sign.bottom == BLACK else sign.ink
        drawing.text(text, (0, y), (width, height), style.bold, colour)


@cache
def sign_png(name: str, style: SignStyle | None = None) -> bytes:
    """The content of a PNG file with the square sign of :func:`sign_face`; cached."""
    return cv2.imencode(".png", cv2.cvtColor(sign_face(name, style=style), cv2.COLOR_RGB2BGR))[1].tobytes()
