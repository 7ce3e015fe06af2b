"""Reference shapes of the elements of .raf files by the format's description, independent of the element library."""

import numpy as np

WALL, TERRAIN, INCLINED, STRAIGHT, CLUTTER = 1, 2, 3, 4, 7
TILE = 1.2


def box(label, x, y, top):
    """Top of an upright box over (x0, x1) × (y0, y1)."""
    return label, lambda u, v: np.where((x[0] <= u) & (u <= x[1]) & (y[0] <= v) & (v <= y[1]), top, -np.inf)


def wedge(x, low, high):
    """A wedge of half width x whose height is linear along y; ``low`` and ``high`` are (y, height)."""
    (y0, h0), (y1, h1) = low, high
    return INCLINED, lambda u, v: np.where(
        (np.abs(u) <= x) & (y0 <= v) & (v <= y1), h0 + (h1 - h0) * (v - y0) / (y1 - y0), -np.inf
    )


def quarter(x, y, height):
    """A quarter of a tile whose height is a function of (x, y)."""
    return INCLINED, lambda u, v: np.where(
        (x[0] <= u) & (u <= x[1]) & (y[0] <= v) & (v <= y[1]), height(u, v), -np.inf
    )


def panel(a, b, top=1.2):
    """A panel 0.01 thick from a to b."""
    a, b = np.array(a), np.array(b)
    along = (b - a) / np.linalg.norm(b - a)

    def height(u, v):
        du, dv = u - a[0], v - a[1]
        t, s = du * along[0] + dv * along[1], dv * along[0] - du * along[1]
        return np.where((np.abs(s) <= 0.005) & (t >= 0) & (t <= np.linalg.norm(b - a)), top, -np.inf)

    return WALL, height


def half_cylinder(top):
    def height(u, v):
        return np.where((u**2 + (v - 0.59) ** 2 <= 0.3**2) & (v <= 0.59), top, -np.inf)

    return CLUTTER, height


def straight_wall(x=0.6, top=1.2):
    return [panel((-x, 0.6), (x, 0.6), top)]


STAIRS = np.linspace(-0.59, 0.59 - 0.25, 5)

ELEMENTS = {
    "half_ramp": [wedge(0.59, (-0.59, 0), (0, 0.17))],
    "half_ramp_shifted": [wedge(0.597, (-0.6, 0.17), (0, 0))],
    "full_ramp": [wedge(0.59, (-0.59, 0.339), (0.59, 0))],
    "elevated_ramps": [
        quarter((0, 0.59), (0, 0.59), lambda u, v: 0.34 - 0.17 * u / 0.59),
        quarter((-0.59, 0), (0, 0.59), lambda u, v: 0.17 * v / 0.59),
        quarter((-0.59, 0), (-0.59, 0), lambda u, v: 0.17 - 0.17 * u / 0.59),
        quarter((0, 0.59), (-0.59, 0), lambda u, v: -0.17 * v / 0.59),
    ],
    "small_wall": straight_wall(),
    "small_wall_qr": straight_wall(),
    "small_wall_start_check": straight_wall(),
    "small_wall_no_tex": straight_wall(0.5),
    "tall_wall": straight_wall(top=2.4),
    "wall_holes1": straight_wall(),
    "small_wall_triple_holes": straight_wall(),
    "wall_diag_120": [panel((-0.6, -0.6), (0.6, 0.6))],
    "corner_diag_120": [panel((0, 0), (-0.6, 0.6)), panel((0, 0), (0.6, 0.6))],
    "veil_wall": straight_wall(),
    "elevated_floor_120": [box(STRAIGHT, (-0.59, 0.59), (-0.59, 0.59), 1.2)],
    "simple_elev_ramp": [wedge(0.59, (-0.59, 0), (0.59, 1.18))],
    "stairs_120": [
        box(CLUTTER, (-0.59, 0.59), (y, y + 0.25), top)
        for y, top in zip(STAIRS, (0.23, 0.43, 0.63, 0.83, 1.03), strict=True)
    ],
    "fiducial_barrel": [half_cylinder(1.19)],
    "red_barrel": [half_cylinder(1.19)],
    "fiducial_barrel_high": [half_cylinder(2.39)],
    "wooden_block": [box(CLUTTER, (-0.05, 0.05), (-0.15, 0.15), 0.1)],
    "pvc_pipe": [(CLUTTER, lambda u, v: np.where(u**2 + v**2 <= 0.025**2, 0.6, -np.inf))],
    "manip_storage": [box(CLUTTER, (-0.59, 0.59), (-0.59, 0.59), 1.005)],
    "floor_tile_black": [box(TERRAIN, (-0.6, 0.6), (-0.6, 0.6), 0.01)],
    "floor_tile_white": [box(TERRAIN, (-0.6, 0.6), (-0.6, 0.6), 0.01)],
    "victim_with_box1": [box(CLUTTER, (-0.25, 0.25), (0.35, 0.59), 0.2)],
    "victim_with_box_q": [box(CLUTTER, (-0.25, 0.25), (0.35, 0.59), 0.2)],
    "victim_doll_heat_with_box": [box(CLUTTER, (-0.25, 0.25), (0.35, 0.59), 0.2)],
    "victim_1": [box(CLUTTER, (-0.2, 0.2), (-0.2, 0.2), 0.2)],
}
"""From above, only the box of a victim is seen.

Shapes in the element's frame, each a label and the height of its top; the height is -inf beside the shape."""

LOOSE = ("hazmat", "start_check", "spectator", "fire_extinguisher", "stepfield")
"""Prefixes of the types whose shape the format does not give to the millimetre."""

MOUNTS = {
    "wall_holes1": ((0.3, 0.9), (0.9, 0.6), (0.3, 0.3)),
    "small_wall_triple_holes": ((0.3, 0.9), (0.9, 0.6), (0.3, 0.3)),
}


def top_of(elements, x, y):
    """Heights and labels at points (N,) of elements: (type, x m, y m, rotation in degrees, (shift along x, up))."""
    height, label = np.zeros_like(x), np.full(x.shape, TERRAIN)
    for kind, x0, y0, rotation, (along, up) in elements:
        yaw = -np.radians(rotation)
        dx, dy = x - x0, y - y0
        u, v = np.cos(yaw) * dx + np.sin(yaw) * dy - along, np.cos(yaw) * dy - np.sin(yaw) * dx
        for shape_label, top in ELEMENTS[kind]:
            here = top(u, v) + up
            label = np.where(here > height, shape_label, label)
            height = np.maximum(here, height)
    return height, label


def steady(elements, x, y, margin=0.002):
    """Whether all points within ``margin`` of (x, y) have the same label and nearly the same height: no edge."""
    height, label = top_of(elements, x, y)
    same = np.ones(x.shape, bool)
    for angle in np.arange(8) * np.pi / 4:
        h, other = top_of(elements, x + margin * np.cos(angle), y + margin * np.sin(angle))
        same &= (other == label) & (np.abs(h - height) < 2 * margin)
    return same
