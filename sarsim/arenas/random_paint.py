"""Random colours and patterns for an arena's materials, so that a network learns shapes rather than textures."""

import colorsys
from collections.abc import Sequence

from sarsim.arenas.elements import ArenaBuilder
from sarsim.arenas.random_draws import RandomDraws

Colour = tuple[float, float, float]  # Red, green, blue, from 0 to 1
_TEXTURES = {"terrain": "concrete", "wall": "osb", "straight_ramp": "plywood"}  # Texture by material
_PLAIN_MATERIALS = ("inclined_ramp", "hole_rim", "ceiling", "board", "timber", "cardboard", "plaster", "grey")
_PATTERNS = ("none", "random", "edge", "cross")
"""MuJoCo's texture marks; edges and crosses make a wall or a floor look tiled."""


def paint(builder: ArenaBuilder, draws: RandomDraws) -> None:
    """Give an arena's materials random colours and, if they have a texture, random patterns."""
    for material, texture in _TEXTURES.items():
        colour = random_colour(draws)
        step: dict[str, str | Sequence[float]] = {
            "builtin": draws.pick(("flat", "gradient")),
            "rgb1": colour,
            "rgb2": _shade(colour, draws),
            "mark": draws.pick(_PATTERNS),
            "markrgb": _shade(colour, draws),
        }
        builder.change_asset("texture", texture, step)
        repeats = draws.number(1, 3)
        builder.change_asset("material", material, {"texrepeat": (repeats, repeats)})
    for material in _PLAIN_MATERIALS:
        builder.change_asset("material", material, {"rgba": (*random_colour(draws), 1.0)})


def random_colour(draws: RandomDraws) -> Colour:
    """A random colour, more often pale than saturated."""
    hue, saturation = draws.number(0, 99) / 100, (draws.number(0, 9) / 10) ** 2
    value = draws.number(20, 95) / 100
    return colorsys.hsv_to_rgb(hue, saturation, value)


def _shade(colour: Colour, draws: RandomDraws) -> Colour:
    """A random shade of a colour, up to 40% darker or 20% lighter."""
    factor = draws.number(60, 120) / 100
    red, green, blue = (min(1.0, factor * c) for c in colour)
    return red, green, blue
