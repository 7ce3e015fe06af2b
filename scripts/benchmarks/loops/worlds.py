"""Worlds in which loop closures matter, built from floor plans; the seed determines niches and furniture."""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from dm_control import mjcf
from numpy.typing import ArrayLike, NDArray

from sarsim.arenas.arena import RescueArena
from sarsim.arenas.elements import ArenaBuilder
from sarsim.arenas.load import load_arena

CELL = 0.2  # m, resolution of the floor plans
WALL_HALF_THICKNESS = 0.05  # m, half thickness of a wall
WALL_HEIGHT = 1.8  # m, default height of the walls
STOREY_HEIGHT = 2.0  # m, height from one floor to the next
WOOD, WHITE, GREY = (0.6, 0.45, 0.3), (0.85, 0.85, 0.82), (0.55, 0.56, 0.58)
Rectangle = tuple[float, float, float, float]  # x0, y0, x1, y1, m


@dataclass(frozen=True, eq=False)
class World:
    """A world to drive through.

    Attributes:
        arena: the world without a robot.
        nodes: (N, 3) m, positions between which the robot may drive in straight lines; None if the robot plans its
            paths on the true ground.
        edges: pairs of neighbouring nodes.
        lap: nodes of a path around the whole world, along which every tour begins.
    """

    arena: RescueArena
    nodes: NDArray[np.float64] | None = None
    edges: frozenset[tuple[int, int]] = frozenset()
    lap: tuple[int, ...] = ()


@dataclass(eq=False)
class Plan:
    """A floor plan: free ground, surrounded by walls.

    Attributes:
        builder: the world built so far.
        low, high: corners of the ground that the plan covers, m.
        floor: height of the floor, m.
    """

    builder: ArenaBuilder
    low: tuple[float, float]
    high: tuple[float, float]
    floor: float = 0.0
    _free: NDArray[np.bool_] = field(init=False)

    def __post_init__(self) -> None:
        size = np.subtract(self.high, self.low) / CELL
        self._free = np.zeros(np.rint(size).astype(int) + 2, np.bool_)  # with a border, which is not free

    def clear(self, *rectangles: Rectangle) -> None:
        """Make rectangles free ground."""
        for x0, y0, x1, y1 in rectangles:
            (i0, j0), (i1, j1) = self._cell(x0, y0), self._cell(x1, y1)
            self._free[i0:i1, j0:j1] = True

    def add_walls(self, height: float = WALL_HEIGHT) -> None:
        """Surround the free ground with walls."""
        for axis in (0, 1):
            ends = np.diff(self._free.astype(np.int8), axis=axis) != 0
            for line, row in enumerate(ends if axis == 0 else ends.T):
                starts, stops = (np.flatnonzero(np.diff(row, prepend=0, append=0) == step) for step in (1, -1))
                for start, stop in zip(starts, stops, strict=True):
                    across = self.low[axis] + line * CELL
                    along = self.low[1 - axis] + (np.array([start, stop]) - 1) * CELL
                    self._add_wall(axis, across, float(along[0]), float(along[1]), height)

    def _add_wall(self, axis: int, across: float, start: float, stop: float, height: float) -> None:
        middle, half = [across, (start + stop) / 2], [WALL_HALF_THICKNESS, (stop - start) / 2 + WALL_HALF_THICKNESS]
        order = slice(None) if axis == 0 else slice(None, None, -1)
        z = self.floor + height / 2
        self.builder.add_box("panel", "wall", (0, 0, 0), 0, (*middle[order], z), (*half[order], height / 2), WHITE)

    def _cell(self, x: float, y: float) -> tuple[int, int]:
        return round((x - self.low[0]) / CELL) + 1, round((y - self.low[1]) / CELL) + 1


def corridor(x0: float, y0: float, x1: float, y1: float, width: float = 2.0) -> Rectangle:
    """A straight corridor, ``width`` m wide, from (x0, y0) to (x1, y1) along x or y."""
    return min(x0, x1) - width / 2, min(y0, y1) - width / 2, max(x0, x1) + width / 2, max(y0, y1) + width / 2


def niches(rng: np.random.Generator, corridors: list[Rectangle], spacing: float = 3.0) -> list[Rectangle]:
    """Niches in the long walls of corridors, of random widths and depths, on average one every ``spacing`` m."""
    found: list[Rectangle] = []
    for x0, y0, x1, y1 in corridors:
        is_along_x = x1 - x0 > y1 - y0
        start, stop = (x0, x1) if is_along_x else (y0, y1)
        for _ in range(rng.poisson((stop - start) / spacing)):
            width, depth = 0.2 * int(rng.integers(2, 7)), 0.2 * int(rng.integers(1, 5))
            at = start + 1.0 + 0.2 * int(rng.integers(0, max(1, int((stop - start - 2.0) / 0.2))))
            if is_along_x:
                y = (y1, y1 + depth) if rng.random() < 0.5 else (y0 - depth, y0)
                found.append((at, y[0], at + width, y[1]))
            else:
                x = (x1, x1 + depth) if rng.random() < 0.5 else (x0 - depth, x0)
                found.append((x[0], at, x[1], at + width))
    return found


def finish_arena(builder: ArenaBuilder, name: str, plan: Plan, start: tuple[float, float, float]) -> RescueArena:
    """Add a floor around the plan, lights and a ``start`` (x and y, m, heading, rad), and return the arena."""
    low, high = np.subtract(plan.low, 1), np.add(plan.high, 1)
    builder.add_floor(low, high)
    builder.add_surroundings(low, high)
    builder.set_start((start[0], start[1], 0.0), start[2])
    return RescueArena(mjcf.from_xml_string(builder.to_xml()), name)


def on_floor(nodes: ArrayLike, floor: float = 0.0) -> NDArray[np.float64]:
    """(N, 3) m, nodes (N, 2) on a floor at this height."""
    places = np.asarray(nodes, np.float64)
    return np.column_stack([places, np.full(len(places), floor)])


def edges_along(*paths: tuple[int, ...]) -> frozenset[tuple[int, int]]:
    """The pairs of neighbouring nodes along paths."""
    return frozenset((a, b) for path in paths for a, b in pairwise(path))


def ring(rng: np.random.Generator) -> World:
    """A ring of corridors, 64 m around, with two dead ends."""
    builder = ArenaBuilder("ring")
    plan = Plan(builder, (-4.0, -12.0), (26.0, 22.0))
    nodes = np.array([(0, 0), (11, 0), (22, 0), (22, 10), (11, 10), (0, 10), (11, -9), (11, 19)], float)
    paths = (0, 1, 2, 3, 4, 5, 0), (1, 6), (4, 7)
    corridors = [corridor(*nodes[a], *nodes[b]) for a, b in ((0, 2), (2, 3), (5, 3), (0, 5), (6, 1), (4, 7))]
    plan.clear(*corridors, *niches(rng, corridors))
    plan.add_walls()
    arena = finish_arena(builder, "ring", plan, (0, 0, 0))
    return World(arena, on_floor(nodes), edges_along(*paths), (0, 1, 2, 3, 4, 5, 0))


def wings(rng: np.random.Generator) -> World:
    """A corridor with two wings that look alike: equal rooms, niches and furniture, 14 m apart."""
    builder = ArenaBuilder("wings")
    plan = Plan(builder, (-3.0, -3.0), (31.0, 13.0))
    own = np.array([(0, 3), (8, 3), (8, 10), (0, 10)], float)
    rooms = [corridor(*own[a], *own[b]) for a, b in ((0, 1), (1, 2), (3, 2), (0, 3))]
    dents, furniture = niches(rng, rooms), [(rng.uniform(1, 7), s) for s in (2.2, 10.8)]
    nodes = [(0, 0), (14, 0)]
    for x in (0.0, 14.0):
        shift = np.array([x, 0, x, 0])
        plan.clear(*(tuple(np.add(r, shift)) for r in (*rooms, *dents)), (x - 1, -1, x + 1, 3))
        for along, y in furniture:
            box = (0.3, 0.15, 0.4)
            builder.add_box("shelf", "clutter", (x + along, y, 0), 0, (0, 0, 0.4), box, WOOD)
        nodes += [tuple(node) for node in own + np.array([x, 0.0])]
    plan.clear(corridor(0, 0, 28, 0), *niches(rng, [(0.0, -1.0, 28.0, -1.0)]))
    plan.add_walls()
    nodes.append((27, 0))
    paths = (0, 2, 3, 4, 5, 2), (1, 6, 7, 8, 9, 6), (0, 1, 10)
    lap = (0, 2, 3, 4, 5, 2, 0, 1, 6, 7, 8, 9, 6, 1, 10)
    return World(finish_arena(builder, "wings", plan, (0, 0, 0)), on_floor(nodes), edges_along(*paths), lap)


def storeys(rng: np.random.Generator) -> World:
    """Two equal storeys, one above the other, joined by a ramp."""
    builder = ArenaBuilder("storeys")
    own = np.array([(0, 0), (12, 0), (12, 12), (0, 12)], float)
    rooms = [corridor(*own[a], *own[b]) for a, b in ((0, 1), (1, 2), (3, 2), (0, 3))]
    dents = [d for d in niches(rng, rooms) if d[2] <= 12.9]
    for level in (0, 1):
        plan = Plan(builder, (-3.0, -3.0), (17.0, 16.0), level * STOREY_HEIGHT)
        # The ramp begins at the south-east corner and ends at the north-east corner.
        landing = (13.0, -1.0, 15.2, 0.6) if level == 0 else (13.0, 11.4, 15.2, 13.0)
        plan.clear(*rooms, *dents, landing, (13.2, 0.6, 15.2, 11.4))
        plan.add_walls(1.85 if level == 0 else 1.3)
    for x0, y0, x1, y1 in (*rooms, *dents, (13.0, 11.4, 15.2, 13.0)):
        middle, half = ((x0 + x1) / 2, (y0 + y1) / 2, STOREY_HEIGHT - 0.05), ((x1 - x0) / 2, (y1 - y0) / 2, 0.05)
        builder.add_geom("terrain", {"type": "box", "pos": middle, "size": half}, GREY)
    corners = np.array(
        [
            (x, y, z)
            for x in (13.2, 15.2)
            for y, z in ((0.6, -0.05), (0.6, 0.0), (11.4, STOREY_HEIGHT), (11.4, STOREY_HEIGHT - 0.1))
        ]
    )
    builder.add_geom("inclined_ramp", {"type": "mesh", "mesh": builder.add_mesh(corners)}, WOOD)
    # Nodes 0 to 3 are on the lower storey, 4 and 5 at the ends of the ramp, and 6 to 9 on the upper storey.
    below, above = np.vstack([own, (14.2, -0.2)]), np.vstack([(14.2, 12.2), own])
    nodes = np.vstack([on_floor(below), on_floor(above, STOREY_HEIGHT)])
    paths = (0, 1, 2, 3, 0), (1, 4, 5, 8), (6, 7, 8, 9, 6)
    lap = (0, 3, 2, 1, 4, 5, 8, 9, 6, 7, 8, 5, 4, 1)
    return World(finish_arena(builder, "storeys", plan, (0, 0, np.pi / 2)), nodes, edges_along(*paths), lap)


def hall(rng: np.random.Generator) -> World:
    """A hall of 40 × 25 m with furniture."""
    builder = ArenaBuilder("hall")
    plan = Plan(builder, (0.0, 0.0), (40.0, 25.0))
    plan.clear((0.0, 0.0, 40.0, 25.0))
    plan.add_walls()
    for x, y in rng.uniform((1, 1), (39, 24), (110, 2)):
        if np.hypot(x - 3, y - 3) < 2.5:
            continue
        half = rng.uniform((0.15, 0.15, 0.2), (0.9, 0.5, 0.9))
        builder.add_box("furniture", "clutter", (x, y, 0), rng.uniform(0, 360), (0, 0, half[2]), half, WOOD)
    return World(finish_arena(builder, "hall", plan, (3, 3, 0)))


def panels(rng: np.random.Generator) -> World:
    """A hall of 24 × 16 m with thin, parallel panels, which the robot often sees edge-on."""
    builder = ArenaBuilder("panels")
    plan = Plan(builder, (0.0, 0.0), (24.0, 16.0))
    plan.clear((0.0, 0.0, 24.0, 16.0))
    plan.add_walls()
    for x in np.arange(2.5, 23, 3.0):
        for y in np.arange(2.0, 15, 2.4):
            if rng.random() < 0.6 and np.hypot(x - 2, y - 1) > 2:
                place, half = (x + rng.uniform(-0.6, 0.6), y + rng.uniform(-0.5, 0.5), 0), rng.uniform(0.4, 0.9)
                yaw = 0 if rng.random() < 0.85 else 90
                builder.add_box("panel", "wall", place, yaw, (0, 0, 0.6), (half, 0.006, 0.6), WOOD)
    return World(finish_arena(builder, "panels", plan, (2, 1, 0)))


WORLDS: dict[str, Callable[[np.random.Generator], World]] = {
    "ring": ring, "wings": wings, "storeys": storeys, "hall": hall, "panels": panels,
}  # fmt: skip


def world_of(name: str, seed: int) -> World:
    """One of ``WORLDS``, or any arena that ``--arena`` takes."""
    if name in WORLDS:
        return WORLDS[name](np.random.default_rng(seed))
    return World(load_arena(name))


def world_name(name: str) -> str:
    """The name of a world in figures."""
    return name if name in WORLDS else Path(name).stem
