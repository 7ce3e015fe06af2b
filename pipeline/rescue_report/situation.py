"""What the robot knows when an episode ends, as a rescue team asks for it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.explorer import Explorer
from pipeline.rescue_report.hazards import Hazards, find_hazards
from pipeline.rescue_report.posture import Posture, posture_of
from pipeline.rescue_report.routes import Route, Router
from pipeline.rescue_report.unseen import Unseen, find_unseen
from pipeline.transforms import yaw_of
from pipeline.traversability.shortest_paths import ShortestPaths
from pipeline.traversability.traversability import Traversability
from pipeline.victims.display_ids import confirmed_ids, unconfirmed_ids
from pipeline.victims.victim_map import Victim


@dataclass(frozen=True, eq=False)
class Person:
    """Someone whom the robot has seen.

    Attributes:
        mark: by which the page calls them: numbers for confirmed ones, letters for others.
        victim: what the robot knows of them.
        posture: their size.
        route: the way to them; None if the robot cannot leave the entrance.
    """

    mark: str
    victim: Victim
    posture: Posture
    route: Route | None


@dataclass(frozen=True, eq=False)
class Situation:
    """All that the page tells, but for figures against a ground truth.

    Attributes:
        T_map_entrance: 4×4 pose in which the robot was set down.
        steps: (N, 2) m in ``map``, where it looked from.
        traversability: the ground.
        points: (N, 3) float32 of the semantic map.
        labels: (N,) uint8 of these.
        hazards: of the ground that it can reach.
        unseen: ground that was not seen.
        people: confirmed.
        sightings: not confirmed.
        searched: whether anyone was looked for at all.
        finished: whether nothing was left that was worth a look.
    """

    T_map_entrance: NDArray[np.float64]
    steps: NDArray[np.float64]
    traversability: Traversability
    points: NDArray[np.float32]
    labels: NDArray[np.uint8]
    hazards: Hazards
    unseen: Unseen
    people: list[Person]
    sightings: list[Person]
    searched: bool
    finished: bool

    @property
    def everyone(self) -> list[Person]:
        """Confirmed or not."""
        return [*self.people, *self.sightings]


def situation_of(explorer: Explorer, poses: Sequence[NDArray[np.float64]], finished: bool) -> Situation:
    """What an explorer knows.

    Args:
        explorer: with its maps and with whom it found; without a detector nobody was looked for.
        poses: 4×4 ones from which it looked, the entrance first.
        finished: whether nothing was left that was worth a look.
    """
    traversability = explorer.mapper.traversability_layer.update(explorer.mapper.elevation_map)
    paths = ShortestPaths(traversability, poses[0][:2, 3])
    points = explorer.mapper.semantic_map.points()
    hazards = find_hazards(traversability, paths.reachable, points)
    router = Router(
        traversability,
        paths,
        explorer.mapper.topological_map,
        explorer.mapper.metric_map,
        hazards,
        yaw_of(poses[0]),
    )
    return Situation(
        T_map_entrance=poses[0],
        steps=np.array([T[:2, 3] for T in poses]),
        traversability=traversability,
        points=points,
        labels=explorer.mapper.semantic_map.labels(),
        hazards=hazards,
        unseen=find_unseen(traversability, explorer.mapper.elevation_map.measured, paths.reachable),
        people=[_person(mark, victim, router) for mark, victim in confirmed_ids(explorer.mapper.victims)],
        sightings=[
            _person(mark, victim, router) for mark, victim in unconfirmed_ids(explorer.mapper.victims)
        ],
        searched=explorer.mapper.detector is not None,
        finished=finished,
    )


def _person(mark: str, victim: Victim, router: Router) -> Person:
    return Person(mark, victim, posture_of(victim.points), router.to(victim.points))
