"""Assign what is found on people to them: one find of heat for each person, and no extinguishers or levers."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from pipeline.tracks.find import HEAT, Find
from pipeline.tracks.track import Track


def one_per_person(
    finds: Sequence[Find], people: Sequence[Track], suspected: Sequence[Track], reach: Mapping[str, float]
) -> Iterator[Find]:
    """The finds, with the heat that parts of one person give off merged into one find in the middle of the person.

    Clothes, blankets and objects in front leave several warm regions of a person. A warm region where no person was
    seen stays where it is. An extinguisher or lever on a person is left out, because it is a part of the person. The
    heat of a person who is only ``suspected`` is merged too, because it supports the suspicion.

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
        yield replace(find, text="", position=person.position, covariance=person.covariance, of_person=True)
