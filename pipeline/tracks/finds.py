"""Finds on the map: signs, codes, objects and heat, and which of them are reported."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from pipeline.arrays import Points, Pose
from pipeline.frame import Frame
from pipeline.tracks.config import ObjectConfig, TracksConfig
from pipeline.tracks.find import HEAT, Find, Reading
from pipeline.tracks.objects import ObjectPolicy, best_returns, observe_reading
from pipeline.tracks.track import Track
from pipeline.tracks.tracks import Tracks, join_one_to_one
from pipeline.transforms import inverse


class Finds(Tracks):
    """All finds except people, confirmed or not.

    Attributes:
        readings: readings in the last frame.
    """

    def __init__(
        self, people: Tracks, config: TracksConfig = TracksConfig(), kinds: Mapping[str, ObjectConfig] | None = None
    ) -> None:
        """Start without finds.

        Args:
            people: the people on the map, who give off heat.
            config: how heat is tracked.
            kinds: how the kinds of the readers are tracked; by default as in :class:`ObjectConfig`.
        """
        super().__init__(join_one_to_one)
        self._kinds = {HEAT: config.heat, **(kinds or {})}
        self._policies: dict[str, ObjectPolicy] = {}
        self.readings: list[Reading] = []
        self._people = people

    @property
    def reported(self) -> list[Find]:
        """The finds to report; a person's heat is one find, and shapes that belong to a person are left out."""
        found = [track.to_find() for track in self.confirmed]
        reach = {
            kind: policy.max_person_distance for kind, policy in self._policies.items() if policy.max_person_distance
        }
        if not any(find.kind in reach for find in found):
            return found  # checking whether people are confirmed takes long, and each step reads this property
        return list(one_per_person(found, self._people.confirmed, self._people.worth_a_look, reach))

    @property
    def flat_find_points(self) -> list[Points]:
        """The points of each confirmed find that is flat, m in ``map``.

        The shape of a flat find on a wall does not distinguish it from the wall; other finds stand out from the wall.
        """
        return [best_returns(track) for track in self.all if track.policy.is_flat and track.is_confirmed]

    def policy_of(self, kind: str) -> ObjectPolicy:
        """The policy for tracking a kind, which may be a kind of a user's own reader."""
        if kind not in self._policies:
            self._policies[kind] = ObjectPolicy(kind=kind, **vars(self._kinds.get(kind) or ObjectConfig()))
        return self._policies[kind]

    def update(self, frame: Frame, readings: Sequence[Reading], T_map_base: Pose, keyframe: int) -> None:
        """Add the readings of a keyframe, and count misses of finds that the keyframe was expected to show.

        Args:
            frame: the keyframe's frame, with its depth.
            readings: readings in the keyframe's image.
            T_map_base: pose of the robot.
            keyframe: index of the keyframe.
        """
        self.readings = list(readings)
        new, T_base_map = [], inverse(T_map_base)
        for reading in readings:
            policy = self.policy_of(reading.kind)
            seen = observe_reading(frame, reading, keyframe, T_map_base, policy)
            new.append(Track(policy, [seen.transformed(T_base_map)], [seen], float(T_map_base[2, 3])))
        self.add(new, frame, T_map_base @ frame.T_base_camera, keyframe)


def one_per_person(
    finds: Sequence[Find], people: Sequence[Track], suspected: Sequence[Track], reach: Mapping[str, float]
) -> Iterator[Find]:
    """Yield the finds; heat from several parts of one person is merged into one find at the middle of the person.

    Clothes, blankets and objects in front of a person leave several warm regions. A warm region where no person was
    seen stays where it is. What looks like an extinguisher or lever on a person is left out, because it is a part of
    the person. The heat of a person who is only ``suspected`` is also merged, because heat supports the suspicion.

    Args:
        finds: finds to report; none of them are people.
        people: the confirmed people.
        suspected: people who are not confirmed.
        reach: maximum distance from a person at which a find belongs to that person, by kind, m.
    """
    everyone = [*people, *suspected]
    trees = [cKDTree(person.points) for person in everyone]
    warm: dict[int, Find] = {}
    for find in finds:
        among = trees if find.kind == HEAT else trees[: len(people)] if find.kind in reach else []
        distances = [float(tree.query(find.position)[0]) for tree in among]
        if min(distances, default=np.inf) > reach.get(find.kind, 0):
            yield find
        elif find.kind == HEAT:
            nearest = int(np.argmin(distances))
            first = warm.get(nearest, find)
            warm[nearest] = first if first.time_s <= find.time_s else find
    for k, find in warm.items():
        person = everyone[k]
        yield replace(find, text="", position=person.position, covariance=person.covariance, is_heat_of_person=True)
