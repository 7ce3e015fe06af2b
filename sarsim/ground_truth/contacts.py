"""The robot's collisions with obstacles."""

import mujoco
import numpy as np

from pipeline.labels import Label
from sarsim.sensors.camera import geom_labels

OBSTACLES = (Label.WALL, Label.CLUTTER, Label.VICTIM)

CHATTER = 0.5
"""s; a contact that two geoms repeat within this time is not counted again, because contacts chatter."""


class CollisionCounter:
    """Counts how often a part of the robot begins to touch a wall, clutter or a victim.

    Attributes:
        collisions: their number so far.
    """

    def __init__(self, model: mujoco.MjModel, base_body: int):
        """``base_body``: id of the robot's root body."""
        self._is_robot = model.body_rootid[model.geom_bodyid] == base_body
        self._is_obstacle = np.isin(geom_labels(model), OBSTACLES) & ~self._is_robot
        # Time of the last contact of each pair of geoms, s.
        self._touched: dict[tuple[int, int], float] = {}
        self.collisions = 0

    def count(self, data: mujoco.MjData) -> None:
        """Add the contacts of the current time step."""
        first, second = data.contact.geom1, data.contact.geom2
        hit = (self._is_robot[first] & self._is_obstacle[second]) | (
            self._is_robot[second] & self._is_obstacle[first]
        )
        for pair in {(int(a), int(b)) for a, b in zip(first[hit], second[hit], strict=True)}:
            self.collisions += data.time - self._touched.get(pair, -np.inf) > CHATTER
            self._touched[pair] = data.time
