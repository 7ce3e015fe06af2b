"""Ties what is found on people to them: one find of heat for each, and no bottles and levers."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial import cKDTree

from pipeline.tracks.find import HEAT, SHAPED, Find
from pipeline.victims.victim_map import TOUCH, Victim

BETWEEN = 0.4
"""m; a warm region no farther from what was seen of a person is of the same person."""


def one_per_victim(
    finds: Sequence[Find], victims: Sequence[Victim], suspected: Sequence[Victim] = ()
) -> Iterator[Find]:
    """The finds, those of heat that parts of one victim give off as a single one in the middle of the victim.

    Clothes, blankets and what stands in front leave several warm regions of a person. They belong to a
    person up to ``BETWEEN``. A single warm region of which no person was seen stays where it is. What looks
    like a bottle or a lever on a victim, within ``TOUCH``, is the victim's own. What is warm of a person who is only
    ``suspected`` is one find too, for its warmth bears it out.
    """
    everyone = [*victims, *suspected]
    trees = [cKDTree(victim.points) for victim in everyone]
    reach = {HEAT: BETWEEN} | dict.fromkeys(SHAPED, TOUCH)
    warm: dict[int, Find] = {}
    for find in finds:
        among = trees if find.kind == HEAT else trees[: len(victims)] if find.kind in reach else []
        distances = [float(tree.query(find.position)[0]) for tree in among]
        if min(distances, default=np.inf) > reach.get(find.kind, 0):
            yield find
        elif find.kind == HEAT:
            nearest = int(np.argmin(distances))
            first = warm.get(nearest, find)
            warm[nearest] = first if first.time_s <= find.time_s else find
    for k, find in warm.items():
        victim = everyone[k]
        yield Find(HEAT, "", victim.position, victim.covariance, find.time_s, find.confidence, find.photo)
