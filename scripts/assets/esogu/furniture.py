"""Furniture of laboratories and offices.

Every piece faces +x; its back lies in the plane x = 0 and is centred on the origin. Tables and desks have a frame
below the top, which leaves too little height for the robot to pass underneath.
"""

from scripts.assets.esogu.parts import Part, moved


def _box(material: str, x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Part:
    """A box labelled clutter that spans the intervals ``x``, ``y`` and ``z``, m."""
    middle = (sum(x) / 2, sum(y) / 2, sum(z) / 2)
    return Part("clutter", material, middle, (x[1] - x[0], y[1] - y[0], z[1] - z[0]))


def _post(material: str, x: float, y: float, z: tuple[float, float], diameter: float) -> Part:
    """An upright cylinder labelled clutter."""
    middle, extent = (x, y, sum(z) / 2), (diameter, diameter, z[1] - z[0])
    return Part("clutter", material, middle, extent, shape="cylinder")


def _lying(material: str, diameter: float, y: tuple[float, float]) -> Part:
    """A cylinder labelled clutter, with its axis along y, centred on the shaft of a machine."""
    middle, extent = (0.45, sum(y) / 2, 0.52), (diameter, diameter, y[1] - y[0])
    return Part("clutter", material, middle, extent, shape="lying_cylinder")


def _oscilloscope(x: float, y: float, z: float) -> list[Part]:
    return [
        _box("instrument", (x - 0.12, x + 0.06), (y - 0.17, y + 0.17), (z, z + 0.2)),
        _box("screen", (x + 0.06, x + 0.065), (y - 0.14, y + 0.04), (z + 0.06, z + 0.17)),
    ]


def _computer(x: float) -> list[Part]:
    return [
        _box("black", (x, x + 0.04), (-0.27, 0.27), (0.86, 1.18)),
        _box("screen", (x + 0.04, x + 0.045), (-0.25, 0.25), (0.88, 1.16)),
        _box("black", (x - 0.06, x + 0.1), (-0.1, 0.1), (0.74, 0.86)),
    ]


PIECES: dict[str, list[Part]] = {
    # A laboratory bench with a blue cupboard below and a shelf for instruments.
    "bench": [
        _box("cabinet", (0.05, 0.68), (-0.88, 0.88), (0.0, 0.86)),
        _box("worktop", (0.0, 0.75), (-0.9, 0.9), (0.86, 0.9)),
        _box("worktop", (0.0, 0.3), (-0.9, 0.9), (1.28, 1.31)),
        _box("steel", (0.02, 0.05), (-0.9, 0.9), (0.9, 1.28)),
        *_oscilloscope(0.2, -0.45, 1.31),
        _box("instrument", (0.06, 0.28), (0.2, 0.55), (1.31, 1.45)),
    ],
    # A bench with drawers and nothing on it.
    "plain_bench": [
        _box("cabinet", (0.05, 0.68), (-0.88, 0.88), (0.0, 0.86)),
        _box("worktop", (0.0, 0.75), (-0.9, 0.9), (0.86, 0.9)),
        _box("steel", (0.68, 0.69), (-0.8, -0.05), (0.62, 0.64)),
        _box("steel", (0.68, 0.69), (0.05, 0.8), (0.62, 0.64)),
    ],
    # A table with four legs.
    "table": [
        _box("wood", (0.0, 0.8), (-0.8, 0.8), (0.71, 0.74)),
        _box("steel", (0.03, 0.77), (-0.77, 0.77), (0.6, 0.71)),
        *(
            _box("steel", (x - 0.02, x + 0.02), (y - 0.02, y + 0.02), (0.0, 0.6))
            for x in (0.06, 0.74)
            for y in (-0.74, 0.74)
        ),
    ],
    # A long table on two plinths.
    "conference_table": [
        _box("wood", (0.0, 1.2), (-1.5, 1.5), (0.7, 0.74)),
        _box("dark_wood", (0.1, 1.1), (-1.4, 1.4), (0.6, 0.7)),
        _box("dark_wood", (0.35, 0.85), (-1.2, -0.8), (0.0, 0.6)),
        _box("dark_wood", (0.35, 0.85), (0.8, 1.2), (0.0, 0.6)),
    ],
    # A writing desk with a computer.
    "desk": [
        _box("wood", (0.0, 0.7), (-0.7, 0.7), (0.71, 0.74)),
        _box("wood", (0.03, 0.64), (-0.66, 0.66), (0.6, 0.71)),
        _box("wood", (0.0, 0.68), (-0.7, -0.66), (0.0, 0.71)),
        _box("wood", (0.05, 0.62), (0.3, 0.7), (0.0, 0.6)),
        *_computer(0.16),
    ],
    # A narrow computer-room desk with the computer underneath.
    "computer_desk": [
        _box("worktop", (0.0, 0.7), (-0.7, 0.7), (0.71, 0.74)),
        _box("steel", (0.03, 0.64), (-0.66, 0.66), (0.6, 0.71)),
        _box("steel", (0.04, 0.66), (-0.7, -0.66), (0.0, 0.71)),
        _box("steel", (0.04, 0.66), (0.66, 0.7), (0.0, 0.71)),
        _box("black", (0.08, 0.52), (0.42, 0.61), (0.02, 0.42)),
        *_computer(0.16),
    ],
    # An office chair on a column with a cross-shaped base.
    "chair": [
        _box("fabric", (0.05, 0.47), (-0.22, 0.22), (0.43, 0.49)),
        _box("fabric", (0.02, 0.07), (-0.2, 0.2), (0.49, 0.95)),
        _box("steel", (0.23, 0.29), (-0.03, 0.03), (0.08, 0.43)),
        _box("black", (0.02, 0.5), (-0.03, 0.03), (0.03, 0.08)),
        _box("black", (0.23, 0.29), (-0.24, 0.24), (0.03, 0.08)),
    ],
    # A round laboratory stool.
    "stool": [
        _post("fabric", 0.2, 0.0, (0.58, 0.64), 0.36),
        _box("steel", (0.18, 0.22), (-0.02, 0.02), (0.04, 0.58)),
        _box("black", (0.0, 0.4), (-0.03, 0.03), (0.0, 0.04)),
        _box("black", (0.17, 0.23), (-0.2, 0.2), (0.0, 0.04)),
    ],
    # A tall cupboard with two doors.
    "cabinet": [
        _box("cabinet", (0.0, 0.43), (-0.45, 0.45), (0.0, 1.9)),
        _box("cabinet_door", (0.43, 0.45), (-0.44, -0.01), (0.08, 1.88)),
        _box("cabinet_door", (0.43, 0.45), (0.01, 0.44), (0.08, 1.88)),
    ],
    # Four lockers side by side.
    "lockers": [
        _box("steel", (0.0, 0.43), (-0.6, 0.6), (0.0, 1.8)),
        *(_box("locker_door", (0.43, 0.45), (y + 0.01, y + 0.29), (0.06, 1.77)) for y in (-0.6, -0.3, 0.0, 0.3)),
    ],
    # An open shelf with books and boxes.
    "shelf": [
        _box("dark_wood", (0.0, 0.35), (-0.5, -0.47), (0.0, 1.9)),
        _box("dark_wood", (0.0, 0.35), (0.47, 0.5), (0.0, 1.9)),
        *(_box("wood", (0.0, 0.35), (-0.47, 0.47), (z, z + 0.03)) for z in (0.04, 0.62, 1.2, 1.78)),
        _box("cardboard", (0.02, 0.33), (-0.4, 0.1), (0.07, 0.4)),
        _box("book_red", (0.04, 0.26), (-0.46, 0.25), (0.65, 0.93)),
        _box("book_blue", (0.04, 0.27), (-0.3, 0.44), (1.23, 1.53)),
    ],
    # A rack of electronic equipment.
    "rack": [
        _box("black", (0.0, 0.7), (-0.3, 0.3), (0.0, 2.0)),
        *(_box("instrument", (0.7, 0.71), (-0.25, 0.25), z) for z in ((0.3, 0.55), (0.7, 0.85), (1.0, 1.4))),
    ],
    # A motor and a generator on a common shaft.
    "machine": [
        _box("concrete", (0.1, 0.8), (-0.95, 0.95), (0.0, 0.3)),
        _lying("motor", 0.42, (-0.85, -0.15)),
        _lying("steel", 0.08, (-0.15, 0.1)),
        _lying("generator", 0.38, (0.1, 0.7)),
        _box("motor", (0.3, 0.6), (-0.65, -0.35), (0.7, 0.82)),
    ],
    # A panel of meters and switches.
    "switchboard": [
        _box("grey", (0.0, 0.5), (-0.6, 0.6), (0.0, 1.9)),
        _box("worktop", (0.5, 0.51), (-0.55, 0.55), (0.3, 1.1)),
        *(_box("screen", (0.5, 0.515), (y - 0.1, y + 0.1), (1.35, 1.55)) for y in (-0.3, 0.0, 0.3)),
    ],
    # A whiteboard on the wall.
    "whiteboard": [
        Part("wall", "white", (0.015, 0, 1.5), (0.03, 2.2, 1.2), solid=False),
        Part("wall", "steel", (0.05, 0, 0.89), (0.1, 2.2, 0.02), solid=False),
    ],
    # A notice board on the wall, with papers.
    "notice_board": [
        Part("wall", "cork", (0.01, 0, 1.5), (0.02, 1.5, 0.9), solid=False),
        *(
            Part("wall", "white", (0.012, y, z), (0.024, 0.21, 0.3), solid=False)
            for y, z in ((-0.4, 1.6), (-0.05, 1.42), (0.4, 1.55))
        ),
    ],
    # A radiator below a window.
    "radiator": [_box("white", (0.03, 0.13), (-0.6, 0.6), (0.12, 0.72))],
    # A seating bench for the corridor.
    "seat_row": [
        _box("wood", (0.05, 0.45), (-0.75, 0.75), (0.4, 0.44)),
        _box("steel", (0.1, 0.4), (-0.65, -0.6), (0.0, 0.4)),
        _box("steel", (0.1, 0.4), (0.6, 0.65), (0.0, 0.4)),
    ],
    # A porter's desk.
    "counter": [
        _box("dark_wood", (0.0, 0.6), (-1.0, 1.0), (0.0, 1.06)),
        _box("worktop", (-0.05, 0.65), (-1.05, 1.05), (1.06, 1.1)),
    ],
    # A waste-paper bin.
    "waste_bin": [_box("grey", (0.03, 0.27), (-0.15, 0.15), (0.0, 0.4))],
    # A plant in a pot.
    "plant": [_post("terracotta", 0.2, 0.0, (0.0, 0.36), 0.36), _post("leaf", 0.2, 0.0, (0.36, 1.2), 0.4)],
    # A fire extinguisher on the wall.
    "extinguisher": [
        _post("red", 0.1, 0.0, (0.55, 1.0), 0.16),
        _box("black", (0.05, 0.15), (-0.02, 0.02), (1.0, 1.1)),
    ],
    # Three boxes, one of them on top of another.
    "cartons": [
        _box("cardboard", (0.0, 0.5), (-0.45, 0.1), (0.0, 0.4)),
        *moved([_box("cardboard", (0.0, 0.4), (-0.2, 0.2), (0.0, 0.35))], 0.08, 0.36, 12),
        *moved([_box("cardboard", (0.0, 0.36), (-0.2, 0.2), (0.4, 0.7))], 0.06, -0.2, -8),
    ],
    # A table on its side, with its legs towards +x.
    "fallen_table": [
        _box("wood", (0.0, 0.03), (-0.8, 0.8), (0.0, 0.8)),
        *(
            _box("steel", (0.03, 0.73), (y - 0.02, y + 0.02), (z - 0.02, z + 0.02))
            for y in (-0.7, 0.7)
            for z in (0.08, 0.72)
        ),
    ],
}
"""The parts of each kind of furniture, by its name."""
