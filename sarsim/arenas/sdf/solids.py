"""The solids of an SDF ``<geometry>``, each as MuJoCo has it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.arrays import Places, Pose, Values
from pipeline.errors import InputError
from pipeline.transforms import FARTHEST, from_rotation
from sarsim.arenas.sdf.colours import Colour
from sarsim.arenas.sdf.heightmaps import BASE, GroundTile, tiles_of
from sarsim.arenas.sdf.meshes import Meshes, MeshSurface
from sarsim.arenas.sdf.pieces import MeshPiece, extruded, pieces_of
from sarsim.arenas.sdf.resources import MissingError
from sarsim.arenas.sdf.values import child_numbers, numbers
from sarsim.arenas.sdf.world import LEFT_OUT, SdfShape
from sarsim.ground_truth.columns import ENDLESS, SEGMENTS
from sarsim.ground_truth.shapes import CUBE, SQUARE, swept

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

THINNEST = 1e-4  # m, half size of what the file makes flat: MuJoCo has no flat solids
PLATE = 0.005  # m, half thickness of a plane that is not level
LEVEL = 1e-9  # A plane's normal with 1 − z below this points up
PLANE = 0.1  # m between the lines of a plane's grid, which MuJoCo asks for


@dataclass(frozen=True, eq=False)
class Solid:
    """A body in the world.

    Attributes:
        kind: MuJoCo's name of its shape; ``mesh`` for a piece of a mesh.
        size: m, MuJoCo's sizes of it.
        T_world: its pose.
        corners: around it, in its own frame.
        piece: of a mesh.
        colour: None if the file gives none.
        tile: of a heightmap; its height field has the lowest point at 0.
    """

    kind: str
    size: Values
    T_world: Pose
    corners: Places
    piece: MeshPiece | None
    colour: Colour | None
    tile: GroundTile | None = None

    @property
    def placed(self) -> dict[str, str | NDArray[np.float64]]:
        """MJCF's attributes of its shape and of its pose in the world."""
        R, position = self.T_world[:3, :3], self.T_world[:3, 3]
        return {"type": self.kind, "pos": position, "quat": Rotation.from_matrix(R).as_quat(scalar_first=True)}


class SolidReader:
    """Makes solids of shapes; each mesh is cut into pieces once."""

    def __init__(self, meshes: Meshes):
        """``meshes``: the world's."""
        self._files = meshes
        self._pieces: dict[object, list[MeshPiece]] = {}

    def solids(self, shape: SdfShape) -> Iterator[Solid]:
        """The solids of a shape; InputError if its numbers make no sense, or a mesh is missing or broken."""
        for form in shape.geometry:
            if form.tag in _PRIMITIVES:
                yield _PRIMITIVES[form.tag](form, shape)
            elif form.tag == "mesh":
                yield from self._meshes(form, shape)
            elif form.tag == "polyline":
                yield from self._extruded(shape)
                return  # several outlines are one body
            elif form.tag == "heightmap":
                for tile in tiles_of(form, shape.T_world, shape.base, self._files.resources, shape.where):
                    yield _ground(tile, shape.colour)
            elif form.tag not in (*LEFT_OUT, "empty"):
                raise InputError(f"{shape.where}: unknown geometry <{form.tag[:40]}>")

    def _meshes(self, form: "Element", shape: SdfShape) -> Iterator[Solid]:
        scale = child_numbers(form, "scale", (1.0, 1.0, 1.0), shape.where)
        uri, submesh = (form.findtext("uri") or "").strip(), (form.findtext("submesh/name") or "").strip()
        centred = (form.findtext("submesh/center") or "").strip() in ("true", "1")
        path = self._files.resources.find(uri, shape.base, shape.where)
        if path is None or path.is_dir():
            raise MissingError(uri, shape.where)
        key = (path, *scale, submesh, centred)
        if key not in self._pieces:
            surfaces = [s for s in self._files.surfaces(path) if submesh in ("", s.name)]
            if not surfaces:
                raise InputError(f"{shape.where}: {path} has no submesh {submesh[:60]!r}")
            scaled = list(_scaled(surfaces, scale, centred))
            if max(float(np.abs(s.vertices).max()) for s in scaled) > FARTHEST:
                raise InputError(f"{shape.where}: {path} reaches farther than {FARTHEST:g} m from its origin")
            self._pieces[key] = [piece for surface in scaled for piece in pieces_of(surface)]
        for piece in self._pieces[key]:
            yield Solid("mesh", np.zeros(0), shape.T_world, piece.vertices, piece, shape.colour or piece.colour)

    def _extruded(self, shape: SdfShape) -> Iterator[Solid]:
        outlines, height = [], 1.0
        for form in shape.geometry.findall("polyline"):
            outlines.append(np.array([numbers(p.text, 2, shape.where) for p in form.findall("point")]))
            height = float(child_numbers(form, "height", (1.0,), shape.where)[0])
        if min(map(len, outlines)) < 3 or height <= 0:
            raise InputError(f"{shape.where}: a <polyline> needs at least three points and a height above 0")
        try:
            piece = extruded(outlines, height)
        except ValueError as error:
            raise InputError(f"{shape.where}: {' '.join(str(error).split())}") from error
        yield Solid("mesh", np.zeros(0), shape.T_world, piece.vertices, piece, shape.colour)


def _scaled(surfaces: list[MeshSurface], scale: NDArray[np.float64], centred: bool) -> Iterator[MeshSurface]:
    """Surfaces scaled along the axes, and moved, if so asked, so that the middle of their bounding box is at 0."""
    every = np.concatenate([s.vertices for s in surfaces])
    middle = (every.min(axis=0) + every.max(axis=0)) / 2 if centred else np.zeros(3)
    order = 1 if np.prod(scale) > 0 else -1  # a mirror image turns triangles inside out
    for s in surfaces:
        yield MeshSurface(s.name, (s.vertices - middle) * scale, s.triangles[:, ::order], s.colour)


def _positive(form: "Element", tags: dict[str, tuple[float, ...]], where: str) -> Values:
    """Sizes in m of a form, halved where its defaults are; InputError if one is negative."""
    values = np.concatenate([child_numbers(form, tag, default, where) for tag, default in tags.items()])
    if (values < 0).any():
        raise InputError(f"{where}: <{form.tag}> must not have a negative size")
    return values


def _box(form: "Element", shape: SdfShape) -> Solid:
    half = np.maximum(_positive(form, {"size": (1.0, 1.0, 1.0)}, shape.where) / 2, THINNEST)
    return Solid("box", half, shape.T_world, CUBE * half, None, shape.colour)


def _round(kind: str, form: "Element", shape: SdfShape) -> Solid:
    """A cylinder, or a capsule, whose length is that of its cylinder."""
    sizes = _positive(form, {"radius": (1.0,), "length": (1.0,)}, shape.where) * (1.0, 0.5)
    radius, half = np.maximum(sizes, THINNEST)
    reach = half + radius * (kind == "capsule")
    corners = swept(np.array([(radius, -reach), (radius, reach)]), SEGMENTS)
    return Solid(kind, np.array([radius, half]), shape.T_world, corners, None, shape.colour)


def _cone(form: "Element", shape: SdfShape) -> Solid:
    radius, length = np.maximum(_positive(form, {"radius": (0.5,), "length": (1.0,)}, shape.where), THINNEST)
    corners = np.vstack([swept(np.array([(radius, -length / 2)]), SEGMENTS), [(0, 0, length / 2)]])
    piece = MeshPiece(corners, np.zeros((0, 3), np.int64), [corners], shape.colour)
    return Solid("mesh", np.zeros(0), shape.T_world, corners, piece, shape.colour)


def _ball(kind: str, tag: str, default: tuple[float, ...], form: "Element", shape: SdfShape) -> Solid:
    radii = np.maximum(_positive(form, {tag: default}, shape.where), THINNEST)
    latitude = np.linspace(-np.pi / 2, np.pi / 2, SEGMENTS // 2 + 1)
    corners = swept(np.stack([np.cos(latitude), np.sin(latitude)], axis=1), SEGMENTS) * radii
    return Solid(kind, radii, shape.T_world, corners, None, shape.colour)


def _ground(tile: GroundTile, colour: Colour | None) -> Solid:
    low, high = float(tile.heights.min()), float(tile.heights.max())
    size = np.array([*tile.half, max(high - low, THINNEST), BASE])
    T = tile.T_world @ from_rotation(np.eye(3), (0.0, 0.0, low))
    return Solid("hfield", size, T, tile.corners - (0.0, 0.0, low), None, colour, tile)


def _plane(form: "Element", shape: SdfShape) -> Solid:
    """A plane that faces along its normal: it ends nowhere; one that is not level becomes a plate of its size."""
    normal = child_numbers(form, "normal", (0.0, 0.0, 1.0), shape.where)
    if not normal.any():
        raise InputError(f"{shape.where}: the <normal> of a <plane> must not be zero")
    try:
        half = np.maximum(_positive(form, {"size": (1.0, 1.0)}, shape.where) / 2, THINNEST)
    except InputError:  # of a size beyond all bounds, for one: it ends nowhere
        half = np.full(2, ENDLESS)
    z = normal / np.linalg.norm(normal)
    x = np.cross([0.0, 1.0, 0.0], z) if abs(z[1]) < 0.9 else np.cross([0.0, 0.0, 1.0], z)
    x /= np.linalg.norm(x)
    T = shape.T_world @ from_rotation(np.column_stack([x, np.cross(z, x), z]), np.zeros(3))
    if T[2, 2] > 1 - LEVEL:
        return Solid("plane", np.array([*half, PLANE]), T, SQUARE * [*half, 0], None, shape.colour)
    size = np.array([*half, PLATE])
    behind = T @ from_rotation(np.eye(3), (0.0, 0.0, -PLATE))
    return Solid("box", size, behind, CUBE * size, None, shape.colour)


_PRIMITIVES: dict[str, Callable[..., Solid]] = {
    "box": _box,
    "cylinder": partial(_round, "cylinder"),
    "capsule": partial(_round, "capsule"),
    "cone": _cone,
    "sphere": partial(_ball, "sphere", "radius", (1.0,)),
    "ellipsoid": partial(_ball, "ellipsoid", "radii", (1.0, 1.0, 1.0)),
    "plane": _plane,
}
