"""Score of the finds besides people: the numbers of objects found and of texts read correctly, by kind.

Reported finds are matched one to one with objects of the same kind within ``MAX_MATCH_DISTANCE``, preferably with the
same text. An object reported twice is scored as one found object and one false alarm.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pipeline.errors import required
from pipeline.mapper import Keyframe, Mapper
from pipeline.sink import Sink
from pipeline.tracks.find import FIND_KINDS, HEAT, Find
from sarsim.arenas.things.thing import Thing, things_of, things_of_kind
from sarsim.scoring.victims import MAX_MATCH_DISTANCE, min_cost_pairs
from sarsim.scoring.visibility import Visibility
from sarsim.simulated_robot import SimulatedRobot


class FindScore(Sink):
    """Records which objects come into view, and compares the reported finds with the true objects."""

    finishing = "scoring the finds"

    def __init__(self, robot: SimulatedRobot, mapper: Mapper):
        """Compare the finds of ``mapper`` with the objects in the arena of ``robot``."""
        model, data = robot.physics.model.ptr, robot.physics.data.ptr
        self._robot, self._mapper, self._has_thermal = robot, mapper, False
        self._things = things_of(model, data)
        self._visibility = Visibility(model, self._things)
        # An unmatched find near a tag on a wall is not a false alarm.
        tags = [body.id for body in map(model.body, range(model.nbody)) if body.name.startswith("fiducial_")]
        self._tag_positions = data.xpos[tags]

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """Mark the objects that are visible in the noise-free image of the newest keyframe."""
        truth = required(self._robot.true_frame)
        self._visibility.add(truth.image)
        self._has_thermal |= keyframe.frame.thermal is not None

    def figures(self) -> dict[str, Any]:
        """Figures by kind; heat is included only with a thermal camera."""
        kinds = [kind for kind in FIND_KINDS if kind != HEAT or self._has_thermal]
        finds = self._mapper.finds.reported
        return {"finds": {kind: self._figures(kind, [f for f in finds if f.kind == kind]) for kind in kinds}}

    def _figures(self, kind: str, finds: Sequence[Find]) -> dict[str, Any]:
        things = things_of_kind(self._things, kind)
        visible = np.array(
            [v for t, v in zip(self._things, self._visibility.visible, strict=True) if t in things], bool
        )
        pairs = matched_pairs(things, finds)
        errors = _distances(things, finds, pairs)
        found = np.isin(np.arange(len(things)), [i for i, _ in pairs])
        unmatched = (find for k, find in enumerate(finds) if k not in {k for _, k in pairs})
        return {
            "present": len(things),
            "visible": int(visible.sum()),
            "found": len(pairs),
            "visible_found": int((visible & found).sum()),
            "read": sum(things[i].text == finds[k].text for i, k in pairs),
            "false_alarms": sum(not self._is_tag(find) for find in unmatched),
            "position_error_m": float(np.median(errors)) if errors else None,
        }

    @property
    def errors(self) -> dict[str, list[float]]:
        """Distances, m, between matched finds and objects, by kind."""
        result, finds = {}, self._mapper.finds.reported
        for kind in FIND_KINDS:
            things, reported = things_of_kind(self._things, kind), [find for find in finds if find.kind == kind]
            result[kind] = _distances(things, reported, matched_pairs(things, reported))
        return result

    def _is_tag(self, find: Find) -> bool:
        return bool((np.linalg.norm(self._tag_positions - find.position, axis=1) <= MAX_MATCH_DISTANCE).any())


def _distances(things: Sequence[Thing], finds: Sequence[Find], pairs: Sequence[tuple[int, int]]) -> list[float]:
    return [float(np.linalg.norm(things[i].centre - finds[k].position)) for i, k in pairs]


def matched_pairs(things: Sequence[Thing], finds: Sequence[Find]) -> list[tuple[int, int]]:
    """Index pairs of matched objects and finds: as many as possible, preferably with the same text."""
    true = np.array([thing.centre for thing in things]).reshape(-1, 3)
    reported = np.array([find.position for find in finds]).reshape(-1, 3)
    distance = np.linalg.norm(true[:, None] - reported, axis=2)
    misread = np.array([[t.text != f.text for f in finds] for t in things]).reshape(distance.shape)
    return min_cost_pairs(np.where(distance <= MAX_MATCH_DISTANCE, distance + MAX_MATCH_DISTANCE * misread, np.inf))
