"""Positions of the copies in a ``<population>``, as in Gazebo classic.

Random positions depend only on the seed ``SEED``, so that a world is always the same; in Gazebo, the positions differ
at every start.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from pipeline.arrays import Places
from pipeline.errors import InputError, required
from sarsim.arenas.sdf.values import child_numbers, pose_of
from sarsim.vetting.model_files import MAX_GEOMS

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

SEED = 0
SPACING = 0.1  # m between the points that are clustered to spread copies evenly over a box
MAX_POINTS = 10_000  # Approximate maximum number of these points in a box, and their number in a cylinder
LINE_AXES = {"linear-x": 0, "linear-y": 1, "linear-z": 2}
"""Distributions along a line, with the index of its axis."""


def places_of(population: "Element", where: str) -> Places:
    """(N, 3) m, positions of a population's copies in the world; the copies are not rotated.

    Raises:
        InputError: a number is invalid, the distribution or the region is unknown, or there are too many copies.
    """
    T, kind = pose_of(population, where), (population.findtext("distribution/type") or "random").strip()
    middle, turn = T[:3, 3], T[:3, :3]
    box, cylinder = population.find("box"), population.find("cylinder")
    if kind == "grid":
        offsets, corner = _grid(population, where)
        return middle + corner + offsets @ turn.T
    count, rng = _count(population, "model_count", where), np.random.default_rng(SEED)
    if box is not None and kind in (*LINE_AXES, "random", "uniform"):
        size = _positive(box, "size", 3, where)
        # As in Gazebo, the box is first centred on its position, then rotated about its lowest corner.
        return middle - size / 2 + _in_box(kind, size, count, rng) @ turn.T
    if cylinder is not None and kind in ("random", "uniform"):
        radius, length = _positive(cylinder, "radius", 1, where)[0], _positive(cylinder, "length", 1, where)[0]
        points = _in_cylinder(radius, length, count if kind == "random" else MAX_POINTS, rng)
        return middle + (points if kind == "random" else _cluster_centres(points, count, rng)) @ turn.T
    raise InputError(
        f"{where}: the distribution type {kind[:40]!r} is unknown or lacks its region: random and uniform need a"
        " <box> or a <cylinder>; linear-x, linear-y and linear-z need a <box>; grid needs neither"
    )


def _grid(population: "Element", where: str) -> tuple[Places, NDArray[np.float64]]:
    """(N, 3) m, positions in a grid relative to the first position, and (3,) m, the first relative to the centre."""
    distribution = required(population.find("distribution"))  # not None, because the population's <type> is grid
    rows, columns = (_count(distribution, tag, where) for tag in ("rows", "cols"))
    _checked_count(rows * columns, where)
    step = child_numbers(distribution, "step", (0.5, 0.5, 0.0), where) * (1, 1, 0)
    cells = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    return np.pad(cells, ((0, 0), (0, 1))) * step, -step * (columns - 1, rows - 1, 0) / 2


def _in_box(kind: str, size: NDArray[np.float64], count: int, rng: np.random.Generator) -> Places:
    """(N, 3) m, positions relative to a box's lowest corner."""
    if kind == "random":
        return rng.uniform(0, size, (count, 3))
    if kind == "uniform":
        spacing = max(SPACING, float(np.sqrt(size[0] * size[1] / MAX_POINTS)))
        axes = [np.arange(0, length, spacing) for length in size[:2]]
        points = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
        return _cluster_centres(np.column_stack([points, rng.uniform(0, size[2], len(points))]), count, rng)
    places = np.tile(size / 2, (count, 1))
    places[:, LINE_AXES[kind]] = size[LINE_AXES[kind]] * np.arange(count) / count
    return places


def _in_cylinder(radius: float, length: float, count: int, rng: np.random.Generator) -> Places:
    """(N, 3) m, random positions in a cylinder with its base at z = 0, denser towards its axis, as in Gazebo."""
    angle, distance = rng.uniform(0, 2 * np.pi, count), rng.uniform(0, radius, count)
    return np.column_stack([distance * np.cos(angle), distance * np.sin(angle), rng.uniform(0, length, count)])


def _cluster_centres(points: Places, count: int, rng: np.random.Generator) -> Places:
    """(count, 3) m, centres of clusters of points (N, 3) m; if there are too few points, they are repeated."""
    if count >= len(points):
        return points[np.arange(count) % len(points)]
    middles, _ = kmeans2(points, count, minit="points", rng=rng)
    return np.asarray(middles, np.float64)


def _count(owner: "Element", tag: str, where: str) -> int:
    value = child_numbers(owner, tag, (1.0,), where)[0]
    return _checked_count(int(value), where)


def _checked_count(count: int, where: str) -> int:
    if not 0 < count <= MAX_GEOMS:
        raise InputError(f"{where}: the number of copies must be from 1 to {MAX_GEOMS}, not {count}")
    return count


def _positive(form: "Element", tag: str, count: int, where: str) -> NDArray[np.float64]:
    values = child_numbers(form, tag, (1.0,) * count, where)
    if (values <= 0).any():
        raise InputError(f"{where}, <{form.tag}>: <{tag}> must be above 0, not {values.min():g}")
    return values
