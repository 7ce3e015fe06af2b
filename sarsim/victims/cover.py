"""Covers of a victim: rubble, a box, a wall panel with a hole, and the block on which a seated victim sits."""

from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Places
from pipeline.labels import Label
from sarsim.victims.mjcf import about_z, geom, quaternion

PANEL_THICKNESS = 0.02  # Thickness of boards and panels, m
MAX_SLOPE = np.radians(28)  # rad, maximum slope of a board in rubble
WALL_SIZE, HOLE_HALF_SIZES = (
    1.2,
    (0.28, 0.24),
)  # m: height and minimum width of a wall panel, and half sizes of its hole
COVER_GAP, RIM_WIDTH = 0.03, 0.05  # m: gap between a person and the cover, and between a hole and the panel's edge
MAX_DEPTH = 0.6  # Maximum depth of a box, m; a person who needs more room sticks out of the box
BOARDS = (("back", 0, -1), ("left", 1, 1), ("right", 1, -1), ("top", 2, 1), ("bottom", 2, -1))
"""The boards of a box: name, axis normal to the board, and side of the box's centre on which the board is."""
WOOD = (0.62, 0.48, 0.33)
CONCRETE = (0.55, 0.54, 0.52)


@dataclass(frozen=True, eq=False)
class PersonCover:
    """Geoms around a person, and points that sample these geoms.

    Attributes:
        geoms: geoms of the body ``cover_<id>``.
        points: (N, 3) m, points in the geoms, in the victim's own frame.
    """

    geoms: list[Element]
    points: Places


def rubble(name: str, person: Places, rng: np.random.Generator) -> PersonCover:
    """Boards that lean on the half of a person farther from the head, and blocks next to this half.

    ``person``: (N, 3) m, points on the person, whose head points to +x; ``name``: prefix of the geoms' names.
    """
    cover = joined([])
    low, high = person.min(axis=0), person.max(axis=0)
    for n in range(rng.integers(3, 5)):
        for _ in range(10):
            middle = np.array([low[0] + (high[0] - low[0]) * rng.uniform(0.08, 0.5), (low[1] + high[1]) / 2])
            yaw = rng.choice([-1, 1]) * np.pi / 2 + rng.uniform(-0.5, 0.5)
            board = _board(f"{name}_board_{n}", middle, yaw, rng, np.concatenate([person, cover.points]))
            if board is not None:
                cover = joined([cover, board])
                break
    for n in range(rng.integers(3, 6)):
        cover = joined([cover, _block(f"{name}_block_{n}", person, cover.points, rng)])
    return cover


def box(name: str, person: NDArray[np.float64]) -> PersonCover:
    """A box around a person, open towards +x; the person's legs may stick out of the box.

    ``person``: (N, 3) m, points on the person; ``name``: prefix of the geoms' names.
    """
    low, high = person.min(axis=0) - COVER_GAP, person.max(axis=0) + COVER_GAP
    high[0], low[2] = min(high[0], low[0] + MAX_DEPTH), PANEL_THICKNESS / 2
    middle, half = (low + high) / 2, (high - low) / 2
    cover = joined([])
    for side, axis, sign in BOARDS:
        centre, size = middle.copy(), half.copy()
        centre[axis] += sign * (half[axis] + PANEL_THICKNESS / 2)
        size[axis] = PANEL_THICKNESS / 2
        cover = joined([cover, _cuboid(f"{name}_{side}", Label.CLUTTER, centre, size, np.eye(3), WOOD)])
    return cover


def wall_with_hole(name: str, person: NDArray[np.float64], chin: NDArray[np.float64]) -> PersonCover:
    """A panel in front of a person, 1.2 m high and at least as wide, with a hole in front of the chin.

    ``person``: (N, 3) m, points on the person; ``chin``: (3,) m; ``name``: prefix of the geoms' names.
    """
    left = max(WALL_SIZE / 2, person[:, 1].max() + RIM_WIDTH)
    right = min(-WALL_SIZE / 2, person[:, 1].min() - RIM_WIDTH)
    x = person[:, 0].max() + COVER_GAP + PANEL_THICKNESS
    wide, high = HOLE_HALF_SIZES
    y = float(np.clip(chin[1], right + wide + RIM_WIDTH, left - wide - RIM_WIDTH))
    z = float(np.clip(chin[2], high, WALL_SIZE - high - RIM_WIDTH))
    pieces = {
        "left": ((y + wide, left), (0, WALL_SIZE)),
        "right": ((right, y - wide), (0, WALL_SIZE)),
        "above": ((y - wide, y + wide), (z + high, WALL_SIZE)),
        "below": ((y - wide, y + wide), (0, z - high)),
    }
    cover = joined([])
    for piece, (across, up) in pieces.items():
        if up[1] - up[0] > 0.01:
            centre = np.array([x, sum(across) / 2, sum(up) / 2])
            size = np.array([PANEL_THICKNESS, (across[1] - across[0]) / 2, (up[1] - up[0]) / 2])
            cover = joined([cover, _cuboid(f"{name}_{piece}", Label.WALL, centre, size, np.eye(3), WOOD)])
    return cover


def seat(name: str, half_sizes: NDArray[np.float64]) -> PersonCover:
    """The block, of ``half_sizes`` (3,) m, on which a seated person sits; the back of the block is at the wall."""
    centre = np.array([half_sizes[0], 0, half_sizes[2]])
    return _cuboid(f"{name}_seat", Label.CLUTTER, centre, half_sizes, np.eye(3), CONCRETE)


def joined(covers: list[PersonCover]) -> PersonCover:
    """All covers joined into one."""
    return PersonCover(
        [g for c in covers for g in c.geoms], np.concatenate([np.empty((0, 3)), *(c.points for c in covers)])
    )


def _board(
    name: str, middle: NDArray[np.float64], yaw: float, rng: np.random.Generator, under: NDArray[np.float64]
) -> PersonCover | None:
    """A board over ``middle``, leaning on the points ``under``, with one end on the floor; None if it is too steep.

    The lower end is moved away from ``middle`` (2,) m until the board's slope is less than ``MAX_SLOPE``.
    ``yaw``: heading in which the board rises, rad; ``under``: (N, 3) m.
    """
    length, width = rng.uniform(0.8, 1.2), rng.uniform(0.12, 0.26)
    along, across = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    t = (under[:, :2] - middle) @ across
    strip = under[np.abs(t) < width / 2 + 0.02]
    # ``reach``: distance from the board's lower end to ``middle``, m.
    for reach in np.arange(0.45, 0.8, 0.05) * length:
        s = (strip[:, :2] - middle) @ along + reach
        rise = np.max(strip[:, 2] / np.maximum(s, 0.02), where=(s > 0) & (s < length), initial=0.0)
        slope = np.arctan(rise)
        if slope < MAX_SLOPE:
            break
    else:
        return None
    x = np.array([*(along * np.cos(slope)), np.sin(slope)])
    rotation = np.stack([x, [*across, 0], np.cross(x, [*across, 0])], axis=1)
    foot = np.array([*(middle - along * reach), 0])
    centre = foot + x * length / 2 + rotation[:, 2] * (PANEL_THICKNESS / 2 + 0.001)
    half = np.array([length, width, PANEL_THICKNESS]) / 2
    return _cuboid(name, Label.CLUTTER, centre, half, rotation, WOOD, rng)


def _block(
    name: str, person: NDArray[np.float64], others: NDArray[np.float64], rng: np.random.Generator
) -> PersonCover:
    """A block on the floor near the half of a person farther from the head; empty if no free place is found."""
    low, high = person.min(axis=0), person.max(axis=0)
    taken = np.concatenate([person, others])
    for _ in range(40):
        size, yaw = rng.uniform(0.03, 0.11, 3), rng.uniform(0, np.pi)
        x = rng.uniform(low[0] - 0.1, (low[0] + high[0]) / 2)
        place = np.array([x, rng.uniform(low[1] - 0.2, high[1] + 0.2)])
        rotation = about_z(yaw)
        near = np.abs((taken[:, :2] - place) @ rotation[:2, :2]) < size[:2] + 0.02
        if not near.all(axis=1).any():
            return _cuboid(name, Label.CLUTTER, np.array([*place, size[2]]), size, rotation, CONCRETE, rng)
    return joined([])


def _cuboid(
    name: str,
    label: Label,
    centre: NDArray[np.float64],
    size: NDArray[np.float64],
    rotation: NDArray[np.float64],
    colour: tuple[float, ...],
    rng: np.random.Generator | None = None,
) -> PersonCover:
    """A box geom, and a grid of points in the box, at most 5 cm apart."""
    rgba = (*np.array(colour) * (rng.uniform(0.75, 1.15) if rng else 1), 1)
    axes = [np.linspace(-half, half, 2 + int(2 * half / 0.05)) for half in size]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    piece = geom(name, label, type="box", pos=centre, quat=quaternion(rotation), size=size, rgba=np.clip(rgba, 0, 1))
    return PersonCover([piece], grid @ rotation.T + centre)
