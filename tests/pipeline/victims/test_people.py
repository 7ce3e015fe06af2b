"""Which tracks are of one person."""

from collections.abc import Sequence

import numpy as np

from pipeline.tracks.find import VICTIM, Reading, box_corners
from pipeline.tracks.track import Observation, Track
from pipeline.victims.people import PeoplePolicy


def seen(keyframe: int, *places: float) -> Observation:
    """What a keyframe shows of a person: blobs of points 0.1 m wide at some x."""
    blob = np.random.default_rng(0).uniform(-0.05, 0.05, (200, 3))
    points = np.concatenate([blob + np.array((x, 0, 0)) for x in places]).astype(np.float32)
    photo, reading = np.zeros((1, 1, 3), np.uint8), Reading(VICTIM, "", box_corners((1, 2, 3, 4)), 0.9)
    return Observation(reading, keyframe, points.mean(axis=0), 1e4 * np.eye(3), np.zeros(3), points, photo)


def track(observations: Sequence[Observation]) -> Track:
    return Track(PeoplePolicy(), list(observations), list(observations))


def test_parts_that_touch_in_one_keyframe_are_one_person_though_few_keyframes_show_what_joins_them() -> None:
    part, policy = track([seen(9, 0.6)]), PeoplePolicy()
    alone = track([seen(k, 0.0) for k in range(9)])
    assert policy.merge_distance(alone, part) == np.inf
    for joint, distance in ((0.5, 0.0), (0.3, np.inf)):
        one = track([*[seen(k, 0.0) for k in range(9)], seen(9, 0.0, joint)])
        assert one.points[:, 0].max() < 0.1
        assert policy.merge_distance(one, part) == policy.merge_distance(part, one) == distance
