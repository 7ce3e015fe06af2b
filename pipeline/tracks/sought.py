"""What the robot may look at again: its place, and from where it was seen or should have been."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.keyframes import Places
from pipeline.sensor import SensorModel

THING_GAP = 0.3  # m of depth between a thing and objects in front of or behind it


def apart(places: Sequence[NDArray[np.float64]]) -> float:
    """Distance, m, between the farthest two of places (3,), m."""
    each = np.array(places)
    return float(np.linalg.norm(each[:, None] - each[None], axis=2).max())


class Sought(Protocol):
    """A thing that is to be looked at again.

    Attributes:
        tried: the places on the ground from which it was to be seen, one each.
        tried_at: (3,) float64 each, these places, m in ``map``.
    """

    tried: list[Places]
    tried_at: list[NDArray[np.float64]]

    @property
    def points(self) -> NDArray[np.float32]:
        """(N, 3) float32 what was seen of it, m in ``map``."""
        ...

    @property
    def cameras(self) -> list[NDArray[np.float64]]:
        """(3,) float64 each, positions of the camera in the frames that show it, m in ``map``."""
        ...

    @property
    def across(self) -> float:
        """m, how wide it may be: so much is to be in the image."""
        ...

    @property
    def is_flat(self) -> bool:
        """Whether it shows the same from wherever it is seen, so that only a nearer view tells more."""
        ...

    def distances(self, sensor: SensorModel) -> tuple[float, float]:
        """Least and greatest horizontal distance, m, from which a camera would show enough of it."""
        ...


class Seeker(Protocol):
    """Keeps what is to be looked at again."""

    @property
    def unconfirmed(self) -> Sequence[Sought]:
        """What is worth another look."""
        ...
