"""Builds arenas from SDF files, which describe Gazebo's worlds and models."""

import logging
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Places
from pipeline.errors import InputError
from pipeline.labels import Label
from pipeline.transforms import transform_places
from sarsim.arenas.elements import ArenaBuilder, Attributes
from sarsim.arenas.sdf.heightmaps import HeightmapGround
from sarsim.arenas.sdf.labels import (
    ShapeFeatures,
    flat_shape_features,
    ground_height_of,
    heightmap_features,
    label_of,
    label_of_ground,
    plane_features,
    shape_features,
)
from sarsim.arenas.sdf.pieces import MAX_PIECES, two_sided, with_volume
from sarsim.arenas.sdf.resources import SEARCHED_PLACES
from sarsim.arenas.sdf.solids import Solid, SolidReader
from sarsim.arenas.sdf.victims import add_victims, victims_of
from sarsim.arenas.sdf.window import Window, solids_within, window_of
from sarsim.arenas.sdf.world import SdfModel, SdfWorld
from sarsim.ground_truth.true_surface import MAX_AREA
from sarsim.robots.model import robot_model
from sarsim.vetting.model_files import MAX_GEOMS

MARGIN = 2.0  # m of ground around everything: enough to drive around the outermost objects (0.6 m) and to view them
PLANE_MARGIN = 2.0
"""m by which infinite planes extend past the margin, because goals may lie beyond the outermost objects."""
MAX_THROWN_FRACTION = 0.1  # Maximum fraction of a world's bodies that may be far from the others
MAX_DISTANCE_RATIO = 3.0  # A body more than this many times as far from the centre as the others is left out
MAX_NAMED = 40  # Maximum number of missing items, and of broken items, that a warning names
HEADROOM = robot_model().headroom  # m; a surface more than this above a model's lowest point is not ground
CUBE_SIDE = 6.0
"""m, side of the cubes into which visible surfaces are split, so that rendering can skip cubes out of view."""
MAX_FACETS = 10_000  # Above this number (0.1 ms each), pieces that collide as their hulls have a single label each
COLLISION_ATTRIBUTES: Attributes = {"group": 3}  # for a geom that collides but is not drawn
VISUAL_ATTRIBUTES: Attributes = {"contype": 0, "conaffinity": 0}

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class _Body:
    """A solid, or a part of a solid, that becomes a geom.

    Attributes:
        solid: the solid to which the geom belongs.
        part: (N, 3) m, corners of a convex part of the solid's mesh piece; None for the whole solid.
        facet: index of the piece's facet that the geom shows, without colliding; None if the geom collides.
        is_seen: whether the geom is drawn.
        corners: (N, 3) m, corners in the world.
        features: features that determine the geom's label.
    """

    solid: Solid
    part: Places | None
    facet: int | None
    is_seen: bool
    corners: Places
    features: ShapeFeatures


def build_sdf(path: Path) -> ArenaBuilder:
    """Build the arena of a world, without marking a start.

    Raises:
        InputError: the file is missing, broken or too large, refers to a file that may be harmful, or contains no
            shape that can be read.
    """
    try:
        world = SdfWorld(path)
        victims = victims_of(world)
        solids = _solids(path, world, {victim.scoped_name for victim in victims})
    except RecursionError as error:
        raise InputError(f"{path}: models or frames are nested too deeply") from error
    solids, window = _in_window(path, solids, _places_of(victims))
    far = [victim for victim in victims if window is not None and not window.contains(victim.T_world[:2, 3])]
    victims = [victim for victim in victims if victim not in far]
    hulls = _pieces_as_hulls(solids)
    facets = sum(len(s.piece.facet_triangles) for s in solids if s.piece is not None and id(s.piece) in hulls)
    plain = hulls if facets > MAX_FACETS else set()
    flat = Counter[str]()
    bodies, thrown = _within_reach([body for solid in solids for body in _bodies(solid, hulls, plain, flat)])
    thrown += [_far_out_text(victim.name, victim.T_world[:2, 3]) for victim in far]
    builder = _build_arena(path, bodies, _places_of(victims), world.is_model)
    add_victims(builder, path, world, victims)
    if said := _left_out_text(path, world, thrown):
        _log.warning("%s: loaded without %s%s", path, said, "" if bodies else "; only an empty floor remains")
    if world.left_out:
        _log.warning("%s: loaded without unsupported elements: %s", path, _counts_text(world.left_out))
    if flat:
        _log.warning("%s: %s", path, ", ".join(f"{kind}: {count}" for kind, count in sorted(flat.items())))
    if hulls:
        _log.warning(
            "%s: collisions use the convex hulls of %s", path, _counts_text({"detailed mesh piece": len(hulls)})
        )
    return builder


def _solids(path: Path, world: SdfWorld, apart: set[str]) -> list[Solid]:
    """The solids of all models whose scoped names are not in ``apart``; InputError if there is nothing to build.

    As in Gazebo, a world in which all models are missing is an empty floor.
    """
    reader, solids = SolidReader(world.meshes), list[Solid]()
    for shape in world.shapes(without=lambda model: model.scoped_name in apart):
        with world.skipping_errors():
            solids += reader.solids(shape)
        if len(solids) > MAX_GEOMS:
            raise InputError(f"{path}: has more shapes than the limit of {MAX_GEOMS}; remove some models")
    if not (solids or apart or world.missing):
        said = _left_out_text(path, world, [])
        found = f"readable shapes; left out {said}" if said else "shapes; add at least one <collision> or <visual>"
        raise InputError(f"{path}: contains no {found}")
    return solids


def _left_out_text(path: Path, world: SdfWorld, far_out: list[str]) -> str:
    """Describe the parts of a world that were left out; ``far_out``: descriptions of bodies that lie too far out."""
    missing, broken = list(dict.fromkeys(world.missing)), list(dict.fromkeys([*world.errors, *far_out]))
    said = [_first_names(missing, ", ") + f" (not found in {SEARCHED_PLACES})"] if missing else []
    said += [_first_names([what.removeprefix(f"{path}, ") for what in broken], "; ")] if broken else []
    return f"{_counts_text({'item': len(missing) + len(broken)})}: {'; '.join(said)}" if said else ""


def _first_names(things: list[str], between: str) -> str:
    """The first ``MAX_NAMED`` names and the number of the others, as text."""
    more = [f"and {len(things) - MAX_NAMED} more"] if len(things) > MAX_NAMED else []
    return between.join([*things[:MAX_NAMED], *more])


def _places_of(victims: list[SdfModel]) -> NDArray[np.float64]:
    """(N, 2) m, positions of victims."""
    return np.array([victim.T_world[:2, 3] for victim in victims]).reshape(-1, 2)


def _far_out_text(name: str, place: NDArray[np.float64]) -> str:
    return f"{name} at ({', '.join(f'{x:.0f}' for x in place)}) m (outside the area that is built)"


def _in_window(path: Path, solids: list[Solid], places: NDArray[np.float64]) -> tuple[list[Solid], Window | None]:
    """The solids of a world, and the window of the world that fits into an arena; None if the whole world fits.

    Solids are cut at the window, unless Gazebo's physics has thrown all solids outside the window out of the world.
    ``places``: (N, 2) m, positions of the victims.
    """
    around = [_box_around(solid) for solid in solids if solid.kind != "plane"]
    boxes = np.concatenate([np.array(around).reshape(-1, 2, 2), np.stack([places, places], axis=1)])
    if not len(boxes) or np.prod(np.ptp(boxes, axis=(0, 1)) + 2 * MARGIN) <= MAX_AREA:
        return solids, None
    middle = boxes.mean(axis=1)
    away = np.linalg.norm(middle - np.median(middle, axis=0), axis=1)
    # The other boxes were thrown out of the world.
    near = boxes[away <= MAX_DISTANCE_RATIO * np.quantile(away, 1 - MAX_THROWN_FRACTION)]
    extent = near[:, 1].max(axis=0) - near[:, 0].min(axis=0)
    if np.prod(extent + 2 * MARGIN) <= MAX_AREA:
        return solids, Window(near[:, 0].min(axis=0), near[:, 1].max(axis=0))
    window = window_of(near, MAX_AREA)
    _log.warning("%s: the world (%.0f × %.0f m) is too large for an arena; building only %s", path, *extent, window)
    return list(solids_within(solids, window)), window


def _box_around(solid: Solid) -> NDArray[np.float64]:
    """(2, 2) m, lowest and highest x, y of a solid."""
    corners = transform_places(solid.T_world, solid.corners)[:, :2]
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def _counts_text(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {kind}{'s' * (count > 1)}" for kind, count in counts.items())


def _pieces_as_hulls(solids: list[Solid]) -> set[int]:
    """The ids of the pieces that collide as one geom: as many as ``MAX_PIECES`` requires, the most detailed first."""
    pieces = [solid.piece for solid in solids if solid.piece is not None]
    hulls = {id(piece) for piece in pieces if not piece.parts}
    parts = sum(len(piece.parts) or 1 for piece in pieces)
    for piece in sorted(pieces, key=lambda piece: -piece.parts_per_metre):
        if parts <= MAX_PIECES:
            break
        if len(piece.parts) > 1:
            parts -= len(piece.parts) - 1
            hulls.add(id(piece))
    return hulls


def _bodies(solid: Solid, hulls: set[int], plain: set[int], flat: Counter[str]) -> Iterator[_Body]:
    """Yield the bodies of a solid.

    A piece in ``hulls`` collides as one body, and a piece in ``plain`` is also drawn as one body. ``flat`` counts the
    parts without volume.
    """
    piece, T = solid.piece, solid.T_world
    facets = [] if piece is None or id(piece) in plain else piece.facet_triangles
    surface = 0.0 if piece is None else piece.upward_area(T[:3, :3])
    if solid.kind == "plane":
        yield _Body(solid, None, None, True, transform_places(T, solid.corners), plane_features(T))
    elif solid.tile is not None:
        corners = transform_places(T, solid.corners)
        yield _Body(solid, None, None, True, corners, heightmap_features(corners, solid.tile.normal_z))
    elif piece is None:
        corners = transform_places(T, solid.corners)
        yield _Body(solid, None, None, True, corners, shape_features(corners))
    else:
        is_hull = id(piece) in hulls
        for part in [piece.vertices] if is_hull else piece.parts:
            thick = with_volume(part)
            if thick is None:  # a line does not collide
                flat["parts without area, which do not collide"] += 1
                continue
            if thick is not part:
                flat["flat parts, which collide as thin plates"] += 1
            corners = transform_places(T, thick)
            features = shape_features(corners) if is_hull else shape_features(corners, surface)
            yield _Body(solid, None if is_hull and thick is part else thick, None, not facets, corners, features)
    for number, triangles in enumerate(facets):
        corners = transform_places(T, triangles.reshape(-1, 3))
        yield _Body(solid, None, number, True, corners, flat_shape_features(corners.reshape(-1, 3, 3), surface))


def _within_reach(bodies: list[_Body]) -> tuple[list[_Body], list[str]]:
    """The bodies without the few, if any, that lie so far out that the world could not be built.

    Gazebo's physics may have thrown such bodies away. The second result describes each removed body, with its
    position.
    """
    if not bodies:
        return [], []
    low, high = _bounds(bodies, np.zeros((0, 2)))
    away, places = np.zeros(len(bodies)), np.zeros((len(bodies), 2))
    for n, body in enumerate(bodies):
        if body.solid.kind != "plane":
            places[n] = body.corners[:, :2].mean(axis=0)
    solid = np.array([body.solid.kind != "plane" for body in bodies])
    if np.prod(high - low) <= MAX_AREA or not solid.any():
        return bodies, []
    away[solid] = np.linalg.norm(places[solid] - np.median(places[solid], axis=0), axis=1)
    typical = np.quantile(away[solid], 1 - MAX_THROWN_FRACTION)
    is_thrown = away > MAX_DISTANCE_RATIO * typical
    thrown = [_far_out_text("an object", place) for place in places[is_thrown]]
    return [body for body, far in zip(bodies, is_thrown, strict=True) if not far], thrown


def _build_arena(path: Path, bodies: list[_Body], places: NDArray[np.float64], is_model: bool) -> ArenaBuilder:
    """Build the arena of bodies, with room for victims at places (N, 2) m.

    A floor is added if there is no ground, or if the file contains only models whose ground is raised.
    """
    builder = ArenaBuilder(path.stem)
    low, high = _bounds(bodies, places)
    natural = HeightmapGround([body.solid.tile for body in bodies if body.solid.tile is not None])
    flat = [body.features for body in bodies if body.is_seen and body.solid.tile is None]
    footprint = float(np.prod(high - low))
    ground = ground_height_of(flat, footprint) if flat else None
    if ground is None:
        ground = natural.height_at(*(low + high) / 2)
    raised = is_model and ground is not None and ground > min(body.features.low for body in bodies) + HEADROOM
    if ground is None or raised:
        ground = 0.0
        builder.add_floor(low, high)
    ends = _ends_of_planes(low, high)
    facet_triangles = defaultdict[tuple[Solid, str], list[Places]](list)
    for body in bodies:
        label = _label(body, ground, footprint, natural).name.lower()
        if body.facet is not None and body.solid.piece is not None:
            facet_triangles[body.solid, label].append(body.solid.piece.facet_triangles[body.facet])
        else:
            builder.add_geom(label, _geom(builder, body, *ends), body.solid.colour)
    for (solid, label), facets in facet_triangles.items():
        for triangles in _group_by_cube(np.concatenate(facets)):
            mesh = builder.add_mesh(*two_sided(triangles))
            builder.add_geom(label, {**solid.mjcf_attributes, "mesh": mesh, **VISUAL_ATTRIBUTES}, solid.colour)
    builder.add_surroundings(low, high)
    return builder


def _label(body: _Body, ground: float, footprint: float, natural: HeightmapGround) -> Label:
    """The label of a body in a world of ``footprint`` m²; a heightmap below the body replaces ``ground``."""
    if body.solid.tile is not None:
        return label_of_ground(body.features.normal_z)
    below = natural.height_at(*body.corners[:, :2].mean(axis=0))
    return label_of(body.features, ground if below is None else below, footprint)


def _bounds(bodies: list[_Body], places: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest (x, y), m, of all bodies except planes and of places (N, 2) m, extended by ``MARGIN``.

    If there are only planes, they have the size in the file, up to the maximum area of an arena. If there are neither
    bodies nor victims, the bounds lie at a distance of ``MARGIN`` from the origin.
    """
    around = np.concatenate([places, *(body.corners[:, :2] for body in bodies if body.solid.kind != "plane")])
    if not len(around) and not bodies:
        around = np.zeros((1, 2))
    elif not len(around):
        around = np.concatenate([body.corners[:, :2] for body in bodies])
        middle, most = bodies[0].solid.T_world[:2, 3], np.sqrt(MAX_AREA) / 2 - MARGIN
        around = np.clip(around, middle - most, middle + most)
    return around.min(axis=0) - MARGIN, around.max(axis=0) + MARGIN


def _ends_of_planes(low: NDArray[np.float64], high: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Lowest and highest (x, y), m, of planes: ``PLANE_MARGIN`` outside the bounds if the arena may be so large."""
    beyond = PLANE_MARGIN if np.prod(high - low + 2 * PLANE_MARGIN) <= MAX_AREA else 0.0
    return low - beyond, high + beyond


def _geom(builder: ArenaBuilder, body: _Body, low: NDArray[np.float64], high: NDArray[np.float64]) -> Attributes:
    """The MJCF attributes of a body's geom; a level plane extends from ``low`` to ``high`` (2,) m."""
    solid, T = body.solid, body.solid.T_world
    if solid.kind == "plane":
        half = (high - low) / 2
        return {"type": "plane", "pos": [*(low + half), T[2, 3]], "size": [*half, solid.size[-1]]}
    if solid.tile is not None:
        return {**solid.mjcf_attributes, "hfield": builder.add_height_field(solid.tile.heights, solid.size)}
    if solid.piece is None:
        return {**solid.mjcf_attributes, "size": solid.size}
    whole = solid.piece.vertices, solid.piece.triangles
    mesh = builder.add_mesh(*(whole if body.part is None else [body.part]))
    return {**solid.mjcf_attributes, "mesh": mesh, **({} if body.is_seen else COLLISION_ATTRIBUTES)}


def _group_by_cube(triangles: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    """Yield triangles (N, 3, 3) m in groups whose centres lie in the same cube of side ``CUBE_SIDE``."""
    middle = triangles.mean(axis=1)
    tile = ((middle - middle.min(axis=0)) // CUBE_SIDE).astype(np.int64)
    _, which = np.unique(tile, axis=0, return_inverse=True)
    for n in range(int(which.max()) + 1):
        yield triangles[which.ravel() == n]
