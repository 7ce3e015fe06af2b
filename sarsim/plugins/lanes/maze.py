"""The search-and-map maze of RoboCup Rescue's fabrication guide: an arena for missions of mapping and search.

The guide's drawing was not available, so the positions of all panels, tubes, diagonals and signs are assumed. The
positions are chosen so that a robot that cannot climb over diagonals still reaches every cell.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import atan2, hypot, pi

import numpy as np
from numpy.typing import NDArray

from pipeline.tracks.find import HAZMAT_CLASSES
from sarsim.arenas.elements import ArenaBuilder
from sarsim.arenas.things.hazmat import SignStyle
from sarsim.arenas.things.models import PAPER_THICKNESS, hazmat_sign, qr_code
from sarsim.arenas.walls import wall_axes

Pair = NDArray[np.float64]
"""Two numbers: x and y in m, or in cells."""
TUBE_PREFIX = "tube_"
"""Prefix of the names of the fiducials' geoms."""
TIMBER, TARP, PLASTIC = (0.76, 0.60, 0.38), (0.10, 0.10, 0.11), (0.55, 0.57, 0.60)
PLAN = r"""
+--+--+--+--+::+--+--+--+--+
|x  x  / |      /  /  /    :
+  +  +  +  +--+  +  +  +  +
|x  x |   /  /  \     /  \ |
+  +  +  +  +--+  +  +  +  +
|/  \              / |/  / |
+  +  +  +  +  +--+  +  +  +
|/ |     |  |/  / |   x  x |
+  +  +  +  +  +  +  +  +  +
:     |/           /  x  x |
+--+--+--+--+--+--+--+--+--+
"""
"""Cells, north (+y) at the top: ``-`` and ``|`` panels, ``:`` entrances, ``/`` and ``\\`` diagonals, ``x`` rooms."""
ENTRANCES = ":"


@dataclass(frozen=True)
class MazeConfig:
    """Dimensions in m, from the guide 2026C as transcribed by teams; values that it leaves open are assumed.

    Attributes:
        cell: side of a cell; there are 9 × 5 cells.
        panel_thickness, panel_height: thickness and height of the 36 panels; their length, a cell, is assumed from a
            board's width.
        tube_count: number of mapping fiducials, tubes that a panel divides into two halves.
        tube_diameter: diameter of the tubes.
        tube_heights: heights of the tubes, used in turn; that tubes stand on the floor is assumed.
        lumber: thickness and height of a 2×4 on edge; a diagonal consists of two side by side.
        cross_length: length of the 2×4s that cross in a room.
        tarp_height: height of the dark tarp that covers the maze; that it also closes the entrances is assumed.
        thing_count: number of QR codes and hazmat signs, which alternate on the panels; assumed.
        code_side, sign_side: sides of the squares of codes and signs; assumed, as elsewhere in the league.
        thing_height: height of the centres of codes and signs, visible to a low robot; assumed.
    """

    cell: float = 1.22
    panel_thickness: float = 0.01
    panel_height: float = 2.2
    tube_count: int = 10
    tube_diameter: float = 0.3
    tube_heights: tuple[float, ...] = (1.0, 2.0)
    lumber: tuple[float, float] = (0.038, 0.089)
    cross_length: float = 1.3
    tarp_height: float = 2.2
    thing_count: int = 20
    code_side: float = 0.16
    sign_side: float = 0.2
    thing_height: float = 0.5


@dataclass(frozen=True)
class Panel:
    """A panel, or the tarp in an entrance, in units of cells.

    Attributes:
        x, y: position of the centre, from the south-west corner of the maze.
        is_along_y: whether the panel runs along y, instead of along x.
        is_entrance: whether the panel is a tarp.
        is_inner: whether there are cells on both sides.
    """

    x: float
    y: float
    is_along_y: bool
    is_entrance: bool
    is_inner: bool


class MazePlan:
    """The plan of a maze in units of cells, read from text like :data:`PLAN`.

    Attributes:
        columns, rows: numbers of cells.
    """

    def __init__(self, text: str = PLAN):
        self._lines = text.strip("\n").splitlines()[::-1]
        self.columns, self.rows = len(self._lines[0]) // 3, len(self._lines) // 2

    def panels(self) -> Iterator[Panel]:
        """All panels and entrances, row by row from the south-west corner."""
        for j in range(self.rows + 1):
            for i in range(self.columns):
                if (symbol := self._lines[2 * j][3 * i + 1]) != " ":
                    yield Panel(i + 0.5, j, False, symbol in ENTRANCES, 0 < j < self.rows)
                if j < self.rows and (symbol := self._lines[2 * j + 1][3 * i]) != " ":
                    yield Panel(i, j + 0.5, True, symbol in ENTRANCES, i > 0)
            if j < self.rows:
                yield Panel(self.columns, j + 0.5, True, self._lines[2 * j + 1][-1] in ENTRANCES, False)

    def cells_with(self, symbols: str) -> list[tuple[int, int, str]]:
        """Column, row and symbol of each cell that contains one of these symbols, such as ``x``."""
        cells = [(i, j, self._lines[2 * j + 1][3 * i + 1]) for j in range(self.rows) for i in range(self.columns)]
        return [cell for cell in cells if cell[2] in symbols]

    def room_centres(self) -> list[tuple[int, int]]:
        """Column and row of the corner at the centre of each room of 2 × 2 cells."""
        cells = {(i, j) for i, j, _ in self.cells_with("x")}
        return sorted((i, j) for i, j in cells if {(i - 1, j), (i, j - 1), (i - 1, j - 1)} <= cells)


def build_maze(config: MazeConfig = MazeConfig()) -> ArenaBuilder:
    """Build the maze with the origin at its centre; the robot starts in the south-western cell, facing along x."""
    builder, plan = ArenaBuilder("maze"), MazePlan()
    size = config.cell * np.array([plan.columns, plan.rows])
    panels = list(plan.panels())
    for panel in panels:
        _add_panel(builder, config, panel, size)
    for number, panel in enumerate([p for p in panels if p.is_inner][: config.tube_count]):
        _add_tube(builder, config, number, panel, size)
    for i, j, symbol in plan.cells_with("/\\"):
        _add_diagonal(builder, config, np.array([i + 0.5, j + 0.5]), 1 if symbol == "/" else -1, size)
    for corner in plan.room_centres():
        _add_cross(builder, config, np.array(corner), size)
    _hang_things(builder, config, [p for p in panels if not (p.is_inner or p.is_entrance)], size)
    low, high = -size / 2 - config.panel_thickness, size / 2 + config.panel_thickness
    builder.add_floor(low, high)
    builder.add_geom("ceiling", {"pos": (0, 0, config.tarp_height + 0.005), "size": (*(size / 2), 0.005)}, TARP)
    builder.add_surroundings(low, high, ceiling=True)
    builder.set_start((*(config.cell / 2 - size / 2), 0.0), 0.0)
    return builder


def _add_panel(builder: ArenaBuilder, config: MazeConfig, panel: Panel, size: Pair) -> None:
    x, y = config.cell * np.array([panel.x, panel.y]) - size / 2
    half = (
        (config.panel_thickness / 2, config.cell / 2)
        if panel.is_along_y
        else (config.cell / 2, config.panel_thickness / 2)
    )
    box = {"pos": (x, y, config.panel_height / 2), "size": (*half, config.panel_height / 2)}
    builder.add_geom("wall", box, TARP if panel.is_entrance else None)


def _add_tube(builder: ArenaBuilder, config: MazeConfig, number: int, panel: Panel, size: Pair) -> None:
    x, y = config.cell * np.array([panel.x, panel.y]) - size / 2
    high = config.tube_heights[number % len(config.tube_heights)]
    builder.add_geom(
        "wall",
        {
            "name": f"{TUBE_PREFIX}{number}",
            "type": "cylinder",
            "pos": (x, y, high / 2),
            "size": (config.tube_diameter / 2, high / 2),
        },
        PLASTIC,
    )


def _add_diagonal(builder: ArenaBuilder, config: MazeConfig, middle: Pair, direction: int, size: Pair) -> None:
    """Add two 2×4s side by side, from corner to corner of a cell."""
    (thick, high), side = config.lumber, config.cell
    _add_beam(
        builder, config.cell * middle - size / 2, direction * pi / 4, hypot(side, side) - 2 * thick, 2 * thick, high
    )


def _add_cross(builder: ArenaBuilder, config: MazeConfig, corner: Pair, size: Pair) -> None:
    for direction in (-1, 1):
        middle = config.cell * corner - size / 2
        _add_beam(builder, middle, direction * pi / 4, config.cross_length, *config.lumber)


def _add_beam(builder: ArenaBuilder, middle: Pair, yaw: float, long: float, thick: float, high: float) -> None:
    builder.add_geom(
        "clutter",
        {
            "pos": (*middle, high / 2),
            "quat": (np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)),
            "size": (long / 2, thick / 2, high / 2),
        },
        TIMBER,
    )


def _hang_things(builder: ArenaBuilder, config: MazeConfig, panels: list[Panel], size: Pair) -> None:
    """Hang QR codes and hazmat signs alternately, evenly spread over the inner faces of the outer panels."""
    around = sorted(panels, key=lambda p: atan2(*(config.cell * np.array([p.y, p.x]) - size[::-1] / 2)))
    for n in range(config.thing_count):
        panel = around[n * len(around) // config.thing_count]
        middle = config.cell * np.array([panel.x, panel.y]) - size / 2
        inwards = np.array([-np.sign(middle[0]), 0.0]) if panel.is_along_y else np.array([0.0, -np.sign(middle[1])])
        normal = np.array([*inwards, 0.0])
        place = np.array([*middle, config.thing_height]) + (config.panel_thickness / 2 + PAPER_THICKNESS) * normal
        thing = (
            qr_code(f"qr_code_{builder.next_thing_number}", f"maze {n // 2}", config.code_side)
            if n % 2 == 0
            else hazmat_sign(
                f"hazmat_sign_{builder.next_thing_number}", HAZMAT_CLASSES[n // 2], config.sign_side, SignStyle()
            )
        )
        builder.add_thing(thing, place, wall_axes(normal))
