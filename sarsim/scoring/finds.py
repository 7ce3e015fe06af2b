"""Whether the robot has found the objects other than people, by kind, and read their texts correctly.

Reported finds are matched one to one with objects of the same kind within ``NEAR``, preferably with the same text. An
object reported twice counts as found once, and as one false alarm.
"""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from pipeline.arrays import Places
from pipeline.tracks.find import FIND_KINDS, HEAT, Find
from sarsim.arenas.things.thing import Thing, of_kind, things_of
from sarsim.scoring.victims import NEAR, pairs_of_least
from sarsim.scoring.visibility import Visibility
from sarsim.sensors.camera import LabelledImage


class FindScore:
    """Records which objects come into view, and compares the reported finds with the true objects."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, others: Places):
        """``others``: positions in the world near which an unmatched find is no false alarm."""
        self._things = things_of(model, data)
        self._visibility, self._others = Visibility(model, self._things), others

    def add(self, image: LabelledImage) -> None:
        """Mark the objects in a noise-free image, clipped to the sensor's range."""
        self._visibility.add(image)

    def report(self, finds: Sequence[Find], has_thermal: bool) -> dict[str, Any]:
        """Figures by kind; heat is included only with a thermal camera."""
        kinds = [kind for kind in FIND_KINDS if kind != HEAT or has_thermal]
        return {kind: self._figures(kind, [find for find in finds if find.kind == kind]) for kind in kinds}

    def _figures(self, kind: str, finds: Sequence[Find]) -> dict[str, Any]:
        things = of_kind(self._things, kind)
        visible = np.array(
            [v for t, v in zip(self._things, self._visibility.visible, strict=True) if t in things], bool
        )
        pairs = matched(things, finds)
        errors = _distances(things, finds, pairs)
        found = np.isin(np.arange(len(things)), [i for i, _ in pairs])
        unmatched = (find for k, find in enumerate(finds) if k not in {k for _, k in pairs})
        return {
            "present": len(things),
            "visible": int(visible.sum()),
            "found": len(pairs),
            "visible_found": int((visible & found).sum()),
            "read": sum(things[i].text == finds[k].text for i, k in pairs),
            "false_alarms": sum(not self._is_other(find) for find in unmatched),
            "position_error_m": float(np.median(errors)) if errors else None,
        }

    def errors(self, finds: Sequence[Find]) -> dict[str, list[float]]:
        """Distances, m, between matched finds and objects, by kind."""
        result = {}
        for kind in FIND_KINDS:
            things, reported = of_kind(self._things, kind), [find for find in finds if find.kind == kind]
            result[kind] = _distances(things, reported, matched(things, reported))
        return result

    def _is_other(self, find: Find) -> bool:
        return bool((np.linalg.norm(self._others - find.position, axis=1) <= NEAR).any())


def _distances(things: Sequence[Thing], finds: Sequence[Find], pairs: Sequence[tuple[int, int]]) -> list[float]:
    return [float(np.linalg.norm(things[i].centre - finds[k].position)) for i, k in pairs]


def matched(things: Sequence[Thing], finds: Sequence[Find]) -> list[tuple[int, int]]:
    """Index pairs of matched objects and finds: as many as possible, preferably with the same text."""
    true = np.array([thing.centre for thing in things]).reshape(-1, 3)
    reported = np.array([find.position for find in finds]).reshape(-1, 3)
    distance = np.linalg.norm(true[:, None] - reported, axis=2)
    misread = np.array([[t.text != f.text for f in finds] for t in things]).reshape(distance.shape)
    return pairs_of_least(np.where(distance <= NEAR, distance + NEAR * misread, np.inf))
