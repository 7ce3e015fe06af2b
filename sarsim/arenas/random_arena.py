"""Random rescue arenas of NIST-like tiles; the same seed gives the same arena on any machine.

The plan of an arena consists of integers (:mod:`sarsim.arenas.layout`). By construction, the start is free, the robot
can drive to every open tile, and each victim lies next to an open tile. The true geometry of the finished arena is
also checked; an arena that fails a check is generated again with other random numbers.
"""

import numpy as np

from pipeline.errors import InputError
from pipeline.tracks.find import VICTIM
from sarsim.arenas.checks import failed_checks
from sarsim.arenas.element_things import add_things
from sarsim.arenas.elements import TILE_SIZE, ArenaBuilder
from sarsim.arenas.layout import Item, Layout, Side, Tile
from sarsim.arenas.random_draws import RandomDraws
from sarsim.arenas.random_furniture import (
    OTHER_WALLS,
    hang_on_walls,
    place_bulky,
    place_furniture,
    place_obstacles,
    scatter_clutter,
)
from sarsim.arenas.random_ground import choose_start, ground_items, lay_ramps, make_maze, wall_items
from sarsim.arenas.random_paint import paint
from sarsim.arenas.random_rooms import Piece, furnish
from sarsim.arenas.random_things import hang_things
from sarsim.arenas.random_victims import PlacedVictim, place_victim
from sarsim.arenas.settings import FRACTION_SETTINGS, RandomArenaConfig
from sarsim.arenas.things.thing import ALIVE, annotate_body
from sarsim.victims.victims import VICTIM_PREFIX

CEILING_HEIGHT = 2.4  # m, height of the ceiling and of all walls under it
FLOOR_MARGIN = 0.1  # m of floor beyond the outer walls
ARENA_ATTEMPTS = 30
_BOUNDS = {"columns": (3, 20), "rows": (3, 20), "victims": (0, 100), "things": (0, 100), "difficulty": (0, 3)}
_BOUNDS |= dict.fromkeys(FRACTION_SETTINGS, (0, 1))  # minimum and maximum of each setting

_Plan = tuple[list[Item], list[Piece], list[PlacedVictim], Tile, Side]
"""Elements, furniture, victims, the tile on which the robot starts, and the side that the robot faces."""


def build_random(seed: int, config: RandomArenaConfig | None = None) -> ArenaBuilder:
    """Build the arena for a seed, including the start.

    Raises:
        InputError: the seed or a setting is out of bounds, or the contents do not fit into the tiles.
    """
    config = config or RandomArenaConfig()
    _check(seed, config)
    difficulty = seed % 4 if config.difficulty is None else config.difficulty
    for attempt in range(ARENA_ATTEMPTS):
        plan = _draw_plan(RandomDraws(np.random.default_rng([seed, attempt])), config, difficulty)
        if plan is None:
            continue
        builder = _build(f"random_{seed}", plan, config)
        if config.painted:
            paint(builder, RandomDraws(np.random.default_rng([seed, attempt, 1])))
        if next(failed_checks(builder.to_xml(), builder.files), None) is None:
            hang_things(builder, config.things, np.random.default_rng([seed, attempt, 2]))
            return builder
    raise InputError(
        f"random arena {seed}: its contents (victims: {config.victims}) do not fit into"
        f" {config.columns} × {config.rows} tiles; use more tiles, or fewer victims, ramps and obstacles"
    )


def _check(seed: int, config: RandomArenaConfig) -> None:
    if seed < 0:
        raise InputError(f"random arena: the seed must be non-negative, not {seed}")
    for name, (low, high) in _BOUNDS.items():
        value = getattr(config, name)
        if value is not None and not low <= value <= high:
            raise InputError(f"random arena: {name} must be from {low} to {high}, not {value:g}")


def _draw_plan(draws: RandomDraws, config: RandomArenaConfig, difficulty: int) -> _Plan | None:
    """A random plan; None if the victims do not fit."""
    layout = Layout(config.columns, config.rows)
    make_maze(layout, draws, config.wall_density)
    start = choose_start(layout, draws)
    if difficulty >= 1:
        lay_ramps(layout, draws, config.ramps, fields=difficulty >= 3)
    victims = []
    for number in range(1, config.victims + 1):
        if (victim := place_victim(layout, draws, str(number), hidden=difficulty >= 2)) is None:
            return None
        victims.append(victim)
    items = place_obstacles(layout, draws, config.clutter, difficulty)
    if difficulty >= 2:
        items += scatter_clutter(layout, draws, config.clutter)
    other_walls: tuple[str, ...] = ()
    if config.furniture:
        items += place_furniture(layout, draws, config.furniture)
        items += hang_on_walls(layout, draws, config.furniture)
        other_walls = OTHER_WALLS
    if config.bulky:
        items += place_bulky(layout, draws, config.bulky)
    pieces = furnish(layout, draws, config.furnished) if config.furnished else []
    items += ground_items(layout)
    items += wall_items(layout, draws, difficulty >= 2, config.ceiling, other_walls)
    return items, pieces, victims, *start


def _build(name: str, plan: _Plan, config: RandomArenaConfig) -> ArenaBuilder:
    """Build the arena of a plan, with the origin at the arena's centre."""
    items, pieces, victims, tile, side = plan
    builder = ArenaBuilder(name)
    corner = -np.array([config.columns, config.rows]) * TILE_SIZE / 2
    for item in items:
        xy = corner + (np.array(item.tile) + 0.5) * TILE_SIZE + np.array(item.shift) / 100
        position = np.array([*xy, 0.0])
        builder.add_element(item.kind, position, item.yaw)
        if item.kind != "hazmat":
            add_things(builder, item.kind, position, item.yaw)
    for piece in pieces:
        piece.add_to(builder, *(corner + (np.array(piece.tile) + 0.5) * TILE_SIZE))
    low, high = builder.bounds
    builder.add_surroundings(low, high, config.ceiling)
    builder.add_floor(low - FLOOR_MARGIN, high + FLOOR_MARGIN)
    if config.ceiling:
        builder.add_ceiling(low, high, CEILING_HEIGHT)
    for victim in victims:
        victim.model.add_to(builder.root, victim.position + np.append(corner, 0.0), victim.yaw)
        annotate_body(builder.root, VICTIM_PREFIX + victim.model.id, VICTIM, state=ALIVE)
    builder.set_start([*(corner + (np.array(tile) + 0.5) * TILE_SIZE), 0.0], side * np.pi / 2)
    return builder
