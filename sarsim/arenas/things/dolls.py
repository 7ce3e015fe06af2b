"""Baby dolls, the victims of rescue arenas, some half under a blanket.

A doll has the same frame as the arena designer's box, which hangs on a wall at y = 0.59 m and is open towards -y. For
a viewer, x points to the right and z up; z = 0 is the middle of the box.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.labels import Label
from sarsim.arenas.things.models import ColouredGeom, ThingModel
from sarsim.victims.body import HAIR, SKIN, TOPS

TRUNK_Y = 0.50  # m, y of a doll's trunk
LYING_HEIGHT = -0.09  # m, z of the trunk of a lying doll
SITTING_HEIGHT = -0.05  # m, z of the trunk of a sitting doll
LIPS, EYE = (0.70, 0.25, 0.25), (0.08, 0.06, 0.06)
BLANKETS = (*TOPS, (0.85, 0.82, 0.75), (0.60, 0.70, 0.85))


def doll(name: str, state: str, rng: np.random.Generator) -> ThingModel:
    """A doll in random colours that sits, or lies with the head to the left or right."""

    def one_of(colours: Sequence[tuple[float, ...]]) -> tuple[float, ...]:
        return colours[int(rng.integers(len(colours)))]

    skin, hair, cloth, cover = one_of(SKIN[:4]), one_of(HAIR), one_of(TOPS), one_of(BLANKETS)
    roll = float(rng.choice([0.0, 0.0, 1.0, -1.0]) * np.pi / 2 + rng.uniform(-0.2, 0.2))
    trunk = np.array([0.0, TRUNK_Y, SITTING_HEIGHT if abs(roll) < 1 else LYING_HEIGHT])
    parts = [_placed(part, roll, trunk) for part in _body(skin, hair, cloth)]
    geoms = [part.geom(name, Label.VICTIM) for part in parts]
    blanket = ColouredGeom("blanket", "ellipsoid", (0, -0.035, -0.10), (0.11, 0.05, 0.075), cover)
    backing = [_placed(blanket, roll, trunk).geom(name, Label.CLUTTER)] if rng.random() < 0.6 else []
    return ThingModel(name, "victim", "", geoms, state=state, backing=backing)


def _body(skin: tuple[float, ...], hair: tuple[float, ...], cloth: tuple[float, ...]) -> list[ColouredGeom]:
    """The parts of a sitting doll, with the centre of its trunk at the origin."""
    parts = [
        ColouredGeom("trunk", "ellipsoid", (0, 0, 0), (0.07, 0.055, 0.085), cloth),
        ColouredGeom("head", "ellipsoid", (0, -0.02, 0.135), (0.062, 0.066, 0.07), skin),
        ColouredGeom("hair", "ellipsoid", (0, 0.0, 0.155), (0.066, 0.064, 0.06), hair),
        ColouredGeom("nose", "ellipsoid", (0, -0.087, 0.128), (0.009, 0.01, 0.01), skin),
        ColouredGeom("lips", "ellipsoid", (0, -0.08, 0.102), (0.017, 0.007, 0.005), LIPS),
    ]
    for side, way in (("left", -1), ("right", 1)):
        parts += [
            ColouredGeom(f"{side}_eye", "ellipsoid", (way * 0.024, -0.081, 0.145), (0.009, 0.006, 0.007), EYE),
            ColouredGeom(f"{side}_sleeve", "ellipsoid", (way * 0.085, -0.02, 0.015), (0.028, 0.028, 0.055), cloth),
            ColouredGeom(f"{side}_hand", "ellipsoid", (way * 0.105, -0.05, -0.045), (0.018, 0.025, 0.03), skin),
            ColouredGeom(f"{side}_leg", "ellipsoid", (way * 0.045, -0.045, -0.095), (0.03, 0.06, 0.03), cloth),
            ColouredGeom(f"{side}_foot", "ellipsoid", (way * 0.055, -0.1, -0.095), (0.02, 0.02, 0.03), skin),
        ]
    return parts


def _placed(part: ColouredGeom, roll: float, trunk: ArrayLike) -> ColouredGeom:
    """A part rotated about y by ``roll``, rad, then shifted by the position ``trunk`` (3,) m."""
    cos, sin = np.cos(roll), np.sin(roll)
    R: NDArray[np.float64] = np.array([(cos, 0, sin), (0, 1, 0), (-sin, 0, cos)])
    return part.moved(R, np.asarray(trunk, np.float64))
