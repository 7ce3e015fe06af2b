"""Surface temperatures in an arena."""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from sarsim.arenas.things.thing import Thing

AMBIENT_TEMPERATURE = 20.0  # °C
SKIN_TEMPERATURE = 34.0  # °C, of a person at rest; a doll with a heat pad is as warm
CLOTHES_TEMPERATURE = 28.0
"""°C, surface temperature of clothes of 0.5 clo on a person at rest at 20 °C, from the heat balance of ISO 7730."""
CLOTH_SUFFIXES = ("top", "bottom", "shoes", "hair")
"""Suffixes of the names of a person's thermally insulating materials."""


def temperatures(model: mujoco.MjModel, things: Sequence[Thing]) -> NDArray[np.float32]:
    """(ngeom + 1,) float32 °C, surface temperature of each geom; the last element is for pixels without a geom."""
    warm = np.full(model.ngeom + 1, AMBIENT_TEMPERATURE, np.float32)
    for thing in things:
        if thing.is_warm:
            cloth = [_is_cloth(model, int(geom)) for geom in thing.geoms]
            warm[thing.geoms] = np.where(cloth, CLOTHES_TEMPERATURE, SKIN_TEMPERATURE)
    return warm


def _is_cloth(model: mujoco.MjModel, geom: int) -> bool:
    material = model.geom_matid[geom]
    return material >= 0 and model.material(material).name.rpartition("_")[2] in CLOTH_SUFFIXES
