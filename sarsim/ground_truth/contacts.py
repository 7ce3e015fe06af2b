"""The robot's collisions with obstacles."""

from collections.abc import Hashable, Iterable, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.labels import Label
from sarsim.sensors.camera import geom_labels

OBSTACLES = (Label.WALL, Label.CLUTTER, Label.VICTIM)

DEBOUNCE_TIME = 0.5
"""s; a contact that recurs between the same geoms within this time is not counted again, because contacts chatter."""

MIN_SUPPORT_NORMAL_Z = float(np.sqrt(0.5))
"""Upward component of the contact normal above which a wall only supports the robot. For example, the side of a floor
plate supports a wheel that rolls onto the plate's upper edge."""


class CollisionCounter:
    """Counts how often a part of the robot begins to touch a wall (from the side), clutter or a victim.

    Attributes:
        collisions: number of collisions so far.
        with_people: number of these collisions that were with a person or doll, living or not.
        with_living: number of times that any part of the robot began to touch a living victim.
    """

    def __init__(self, model: mujoco.MjModel, base_body: int, living: Sequence[NDArray[np.integer]] = ()):
        """``base_body``: id of the robot's root body; ``living``: (N,) ids of the geoms of each living victim."""
        is_robot = model.body_rootid[model.geom_bodyid] == base_body
        is_obstacle = np.isin(geom_labels(model), OBSTACLES) & ~is_robot
        # 1 for a geom of the robot, 2 for an obstacle, so that only a pair of both adds up to 3. A list is faster
        # than an array, because contacts are few.
        self._kind: list[int] = (is_robot + 2 * is_obstacle).tolist()
        self._is_wall: list[bool] = (geom_labels(model) == Label.WALL).tolist()
        self._is_person: list[bool] = (geom_labels(model) == Label.VICTIM).tolist()
        self._victim_of = {int(geom): number for number, geoms in enumerate(living) for geom in geoms}
        # Time of the last contact of each pair of geoms, and with each living victim, s.
        self._touched: dict[Hashable, float] = {}
        self.collisions = self.with_people = self.with_living = 0

    def count(self, data: mujoco.MjData) -> None:
        """Add the contacts of the current time step."""
        touches = enumerate(data.contact.geom.tolist())
        met = [(number, a, b) for number, (a, b) in touches if self._kind[a] + self._kind[b] == 3]
        pairs = {(a, b) for number, a, b in met if not self._is_support(a, b, data.contact.frame[number])}
        with_people = {(a, b) for a, b in pairs if self._is_person[a] or self._is_person[b]}
        met_people = self._count_new(with_people, data.time)
        self.with_people += met_people
        self.collisions += met_people + self._count_new(pairs - with_people, data.time)
        if pairs and self._victim_of:
            victims = {self._victim_of[geom] for pair in pairs for geom in pair if geom in self._victim_of}
            self.with_living += self._count_new(victims, data.time)

    def _is_support(self, a: int, b: int, frame: NDArray[np.float64]) -> bool:
        """Whether a wall only supports the robot; ``frame``: (9,), whose first row points from geom a to geom b."""
        upward = frame[2] if self._is_wall[a] else -frame[2]
        return (self._is_wall[a] or self._is_wall[b]) and upward > MIN_SUPPORT_NORMAL_Z

    def _count_new(self, touches: Iterable[Hashable], time: float) -> int:
        """Number of the ``touches`` at ``time``, s, that have just begun; stores the time of all ``touches``."""
        begun = 0
        for touch in touches:
            begun += time - self._touched.get(touch, -np.inf) > DEBOUNCE_TIME
            self._touched[touch] = time
        return begun
