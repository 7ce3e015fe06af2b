"""The floor plan: rooms, furniture, the robot's course and the victims.

All lengths are in m. x runs along the building and y across it; the origin is the centre of the floor. In y, the
corridor extends from -0.60 to 2.00, the rooms south of it from -7.30 to -0.72, those north of it from 2.12 to 7.30.
"""

from dataclasses import dataclass

from sarsim.victims.victims import Placement, Posture
from scripts.assets.esogu.building import Room

Place = tuple[str, float, float, float]  # Kind, x, y (m) and yaw (deg) of a piece of furniture or an arena element

EAST, NORTH, WEST, SOUTH = 0.0, 90.0, 180.0, -90.0  # Yaw of an object that faces this direction, deg

SOUTH_ROOMS = (
    Room("electronics laboratory", -25.9, -16.04, (-24.2, -17.6), (1, -1), (-24.0, -21.5, -19.0)),
    Room("circuits laboratory", -16.04, -7.0, (-14.6, -8.6), (0, -1), (-14.5, -12.0, -9.5)),
    Room("machines laboratory", -7.0, 3.12, (-5.2, 1.6), (1, 0), (-5.0, -2.5, 2.0)),
    Room("robotics laboratory", 3.12, 14.12, (4.7, 11.4), (1, -1), (4.6, 7.2, 9.8, 12.4)),
    Room("power laboratory", 14.12, 25.9, (15.6, 23.9), (1, -1), (16.0, 18.5, 21.0, 23.5)),
)  # fmt: skip
NORTH_ROOMS = (
    Room("entrance hall", -25.9, -20.0, (-24.3, -23.2, -22.1), (0, 0, 0), (-24.5, -21.5)),
    Room("office 1", -20.0, -16.0, (-17.4,), (-1,), (-18.0,)),
    Room("office 2", -16.0, -12.0, (-14.8,), (1,), (-14.0,)),
    Room("computer room", -12.0, -3.0, (-10.6, -4.5), (1, -1), (-10.5, -7.5, -4.5)),
    Room("meeting room", -3.0, 3.0, (1.8,), (-1,), (-1.5, 1.5)),
    Room("office 3", 3.0, 7.0, (4.4,), (1,), (5.0,)),
    Room("office 4", 7.0, 11.0, (9.6,), (-1,), (9.0,)),
    Room("store", 11.0, 17.0, (15.2,), (0,), ()),
    Room("signals laboratory", 17.0, 25.9, (18.3, 24.3), (0, -1), (18.5, 21.5, 24.5)),
)  # fmt: skip
COLUMNS = tuple((x, y) for x in (-19.5, -13.0, -6.5, 0.0, 6.5, 13.0, 19.5) for y in (-4.0, -0.66, 2.06))
"""x, y of the columns' centres, m."""


def _row(kind: str, first: tuple[float, float], last: tuple[float, float], count: int, yaw: float) -> list[Place]:
    """``count`` equally spaced pieces of one kind from ``first`` to ``last``, both included."""
    steps = [n / (count - 1) for n in range(count)]
    return [(kind, first[0] + t * (last[0] - first[0]), first[1] + t * (last[1] - first[1]), yaw) for t in steps]


FURNITURE: dict[str, list[Place]] = {
    "corridor": [
        *_row("lockers", (-22.0, -0.6), (-20.8, -0.6), 2, NORTH), ("notice_board", -16.1, 2.0, SOUTH),
        ("seat_row", -11.2, -0.6, NORTH), ("extinguisher", -12.0, 2.0, SOUTH),
        ("notice_board", -2.0, -0.6, NORTH), ("seat_row", -1.6, 2.0, SOUTH),
        ("waste_bin", -0.5, 2.0, SOUTH), ("extinguisher", 3.2, -0.6, NORTH),
        ("notice_board", 8.0, 2.0, SOUTH), *_row("lockers", (17.4, -0.6), (18.6, -0.6), 2, NORTH),
        ("extinguisher", 21.0, 2.0, SOUTH), ("seat_row", 21.8, -0.6, NORTH), ("plant", 25.8, 1.6, WEST),
        ("cartons", 13.7, 2.0, SOUTH),
    ],
    "electronics laboratory": [
        *_row("plain_bench", (-24.4, -7.3), (-20.8, -7.3), 3, NORTH),
        *_row("bench", (-23.4, -3.75), (-21.6, -3.75), 2, NORTH),
        *_row("bench", (-23.4, -3.75), (-21.6, -3.75), 2, SOUTH), ("stool", -23.5, -2.85, NORTH),
        ("stool", -21.4, -4.65, SOUTH), ("stool", -24.2, -6.45, NORTH), ("whiteboard", -25.8, -3.6, EAST),
        *_row("cabinet", (-16.1, -5.9), (-16.1, -4.1), 3, WEST), ("radiator", -19.0, -7.3, NORTH),
        ("table", -18.0, -3.3, SOUTH), ("waste_bin", -25.8, -6.9, EAST),
    ],
    "circuits laboratory": [
        *_row("bench", (-15.98, -6.2), (-15.98, -4.4), 2, EAST),
        *_row("bench", (-12.05, -5.3), (-12.05, -3.5), 2, EAST),
        *_row("bench", (-12.05, -5.3), (-12.05, -3.5), 2, WEST),
        *_row("plain_bench", (-7.06, -6.2), (-7.06, -4.4), 2, WEST), ("stool", -15.2, -4.6, EAST),
        ("stool", -11.25, -3.4, EAST), ("stool", -7.85, -5.2, WEST), ("radiator", -12.0, -7.3, NORTH),
        *_row("cabinet", (-11.7, -0.72), (-10.8, -0.72), 2, SOUTH), ("whiteboard", -7.06, -2.2, WEST),
    ],
    "machines laboratory": [
        *_row("machine", (-5.7, -7.3), (-1.1, -7.3), 3, NORTH), ("switchboard", -6.94, -2.4, EAST),
        ("switchboard", -1.6, -0.72, SOUTH), ("cabinet", -2.9, -0.72, SOUTH),
        ("fallen_table", -3.6, -3.9, 25.0), ("radiator", 2.0, -7.3, NORTH), ("cartons", 3.06, -1.9, WEST),
    ],
    "robotics laboratory": [
        *_row("desk", (3.18, -6.2), (3.18, -4.7), 2, EAST), ("chair", 4.38, -6.2, WEST),
        ("shelf", 3.18, -3.3, EAST), ("whiteboard", 8.0, -0.72, SOUTH), ("cabinet", 14.06, -4.0, WEST),
        ("plain_bench", 14.06, -2.3, WEST), *_row("radiator", (7.2, -7.3), (9.8, -7.3), 2, NORTH),
        ("cartons", 5.9, -7.3, NORTH),
    ],
    "power laboratory": [
        *_row("bench", (15.9, -4.2), (17.7, -4.2), 2, NORTH),
        *_row("bench", (15.9, -4.2), (17.7, -4.2), 2, SOUTH),
        *_row("bench", (21.4, -4.2), (23.2, -4.2), 2, NORTH),
        *_row("bench", (21.4, -4.2), (23.2, -4.2), 2, SOUTH), ("switchboard", 25.8, -2.5, WEST),
        ("switchboard", 25.8, -5.6, WEST), ("rack", 14.18, -6.6, EAST),
        *_row("radiator", (16.0, -7.3), (21.0, -7.3), 2, NORTH), ("stool", 16.3, -3.4, NORTH),
        ("stool", 21.0, -5.0, SOUTH), ("stool", 23.4, -3.3, NORTH), ("cabinet", 20.6, -0.72, SOUTH),
        ("table", 19.0, -7.15, NORTH),
    ],
    "entrance hall": [
        ("counter", -20.7, 5.0, WEST), ("plant", -25.8, 2.7, EAST), ("plant", -25.8, 6.9, EAST),
        ("seat_row", -25.8, 4.9, EAST), ("notice_board", -23.0, 7.3, SOUTH),
        ("radiator", -24.6, 7.3, SOUTH),
    ],
    "office 1": [
        ("desk", -19.94, 5.6, EAST), ("chair", -18.75, 5.6, WEST), ("shelf", -19.94, 3.9, EAST),
        ("cabinet", -16.06, 6.4, WEST), ("radiator", -18.0, 7.3, SOUTH), ("waste_bin", -19.94, 6.8, EAST),
    ],
    "office 2": [
        ("desk", -12.06, 4.6, WEST), ("chair", -13.25, 4.6, EAST), ("shelf", -12.06, 6.3, WEST),
        ("cabinet", -15.94, 6.6, EAST),
    ],
    "computer room": [
        *_row("computer_desk", (-10.8, 7.3), (-5.0, 7.3), 5, SOUTH),
        *_row("computer_desk", (-8.9, 4.4), (-6.1, 4.4), 3, NORTH),
        *_row("computer_desk", (-8.9, 4.4), (-6.1, 4.4), 3, SOUTH), ("chair", -10.7, 6.15, NORTH),
        ("chair", -7.9, 6.15, 75.0), ("chair", -6.4, 6.15, NORTH), ("chair", -8.8, 3.25, NORTH),
        ("chair", -6.0, 3.22, 100.0), ("whiteboard", -11.94, 4.6, EAST), ("rack", -3.06, 6.8, WEST),
    ],
    "meeting room": [
        ("conference_table", -0.3, 4.25, NORTH), *_row("chair", (-1.3, 3.85), (0.7, 3.85), 3, NORTH),
        *_row("chair", (-1.3, 5.85), (0.7, 5.85), 3, SOUTH), ("whiteboard", -2.94, 4.8, EAST),
        ("radiator", 1.5, 7.3, SOUTH), ("plant", 2.94, 6.9, WEST),
    ],
    "office 3": [
        ("desk", 6.94, 4.8, WEST), ("chair", 5.75, 4.72, 10.0), ("cabinet", 3.06, 6.6, EAST),
        ("shelf", 6.94, 6.6, WEST), ("radiator", 5.0, 7.3, SOUTH),
    ],
    "office 4": [
        ("desk", 7.06, 5.0, EAST), ("chair", 8.25, 5.0, WEST), ("cabinet", 10.94, 6.5, WEST),
        ("shelf", 7.06, 3.2, EAST), ("plant", 10.94, 5.5, WEST),
    ],
    "store": [
        *_row("shelf", (11.06, 2.8), (11.06, 6.8), 5, EAST),
        *_row("shelf", (12.9, 7.3), (14.9, 7.3), 3, SOUTH), ("plain_bench", 16.94, 6.3, WEST),
        ("cartons", 16.94, 3.2, WEST),
    ],
    "signals laboratory": [
        *_row("bench", (19.0, 7.17), (22.6, 7.17), 3, SOUTH),
        *_row("plain_bench", (20.4, 4.6), (22.2, 4.6), 2, NORTH),
        *_row("bench", (20.4, 4.6), (22.2, 4.6), 2, SOUTH), ("stool", 20.2, 5.5, NORTH),
        ("stool", 22.3, 3.75, SOUTH), ("rack", 25.8, 6.8, WEST), ("cabinet", 25.8, 4.8, WEST),
        ("cabinet", 25.8, 3.9, WEST), ("whiteboard", 17.06, 4.6, EAST),
    ],
}  # fmt: skip
"""Furniture by room. A free lane at least 0.9 m wide leads into every room and around every island of furniture."""

COURSE: list[Place] = [
    # Machines laboratory: three ridges, each two tiles wide, one behind another along y.
    *(("ridge", x, y, NORTH) for x in (1.1, 2.3) for y in (-6.1, -4.9, -3.7)),
    # Robotics laboratory: a high deck between two ramps; next to it, behind a wall, two ridges in a row.
    ("ramp_34", 7.9, -3.2, 90.0),
    ("deck_34", 9.1, -3.2, 0.0),
    ("deck_34", 10.3, -3.2, 0.0),
    ("ramp_34", 11.5, -3.2, -90.0),
    *(("small_wall", x, -4.4, 0.0) for x in (7.9, 10.3, 11.5)),
    ("wall_holes1", 9.1, -4.4, 0.0),
    ("ridge", 9.1, -4.4, EAST),
    ("ridge", 10.3, -4.4, EAST),
    ("barrel", 7.2, -6.4, 0.0),
    # Corridor: a low deck between two ramps on the south side, a ridge on the north side.
    ("ramp_17", 6.7, 0.0, 90.0),
    ("deck_17", 7.9, 0.0, 0.0),
    ("deck_17", 9.1, 0.0, 0.0),
    ("ramp_17", 10.3, 0.0, -90.0),
    ("ridge", 16.6, 1.4, EAST),
]
"""Elements of the arena library. A ridge is two ramps that meet at the top, to be driven over along its yaw."""


@dataclass(frozen=True)
class VictimPlan:
    """A victim: its posture, its placement, and its pose with x, y in m and yaw in deg."""

    posture: Posture
    placement: Placement
    x: float
    y: float
    yaw: float


VICTIMS = (
    VictimPlan("lying", "open", -8.0, 1.45, 0.0),  # corridor
    VictimPlan("prone", "open", -22.4, -5.4, 10.0),  # electronics, between two rows of benches
    VictimPlan("sitting", "open", -9.4, -7.3, NORTH),  # circuits, below the window
    VictimPlan("side", "open", -4.4, 5.6, 80.0),  # computer room
    VictimPlan("slumped", "open", -14.2, 7.3, SOUTH),  # office 2, below the window
    VictimPlan("lying", "open", -3.4, -5.2, 160.0),  # machines, in front of the machines
    VictimPlan("side", "hole", 13.3, -6.2, WEST),  # robotics, behind the course
    VictimPlan("lying", "rubble", 13.0, 4.9, 30.0),  # store, half buried
    VictimPlan("seated", "open", 25.8, -4.1, WEST),  # power, behind an island
    VictimPlan("bust", "box", 24.0, 5.6, -120.0),  # signals, in a box
)
"""The victims; their ids count from 1 in this order."""

START = (-25.0, 0.7)  # x, y in m at the corridor's west end; the robot faces along the corridor
