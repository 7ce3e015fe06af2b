"""Ties what is found on people to them: one find of heat for each, and no bottles and levers."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from pipeline.tracks.find import HEAT, Find
from pipeline.tracks.track import Track


def one_per_person(
    finds: Sequence[Find], people: Sequence[Track], suspected: Sequence[Track], reach: Mapping[str, float]
) -> Iterator[Find]:
    """The finds, those of heat that parts of one person give off as a single one in the middle of the person.

    Clothes, blankets and what stands in front leave several warm regions of a person. A single warm region of which
    no person was seen stays where it is. What looks like a bottle or a lever on a person is the person's own. What is
    warm of a person who is only ``suspected`` is one find too, for its warmth bears it out.

    Args:
        finds: without people.
        people: confirmed.
        suspected: people who are not confirmed.
        reach: by kind, distance from a person up to which a find belongs to that person, m.
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
        yield replace(find, text="", position=person.position, covariance=person.covariance, of_person=True)
