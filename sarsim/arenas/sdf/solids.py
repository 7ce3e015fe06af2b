"""The solids of an SDF ``<geometry>``, as MuJoCo represents them."""

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
from sarsim.arenas.sdf.heightmaps import BASE_THICKNESS, GroundTile, tiles_of
from sarsim.arenas.sdf.meshes import Meshes, MeshSurface
from sarsim.arenas.sdf.pieces import MeshPiece, extruded, pieces_of
from sarsim.arenas.sdf.resources import MissingError
from sarsim.arenas.sdf.values import child_numbers, numbers
from sarsim.arenas.sdf.world import LEFT_OUT, SdfShape
from sarsim.ground_truth.columns import INFINITE_PLANE_HALF_SIZE, SEGMENTS
from sarsim.ground_truth.shapes import CUBE, SQUARE, swept

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

MIN_HALF_SIZE = 1e-4  # m, minimum half size of solids that are flat in the file, because MuJoCo has no flat solids
PLATE_HALF_THICKNESS = 0.005  # m, half thickness of the plate that replaces a plane that is not level
LEVEL_TOLERANCE = 1e-9  # A plane is level and faces up if 1 − z of its normal is below this
GRID_SPACING = 0.1  # m, spacing of a plane's grid lines, which MuJoCo requires as one of its sizes


@dataclass(frozen=True, eq=False)
class Solid:
    """A shape in the world, as MuJoCo represents it.

    Attributes:
        kind: MuJoCo's name for the type of geom; ``mesh`` for a piece of a mesh.
        size: MuJoCo's sizes, m.
        T_world: pose in the world.
        corners: (N, 3) m, points in the solid's own frame whose convex hull contains the solid.
        piece: piece of a mesh; None for other types of geom.
        colour: colour of the solid; None if the file gives none.
        tile: tile of a heightmap, whose lowest point is at z = 0 of the solid's frame; None for other types of geom.
    """

    kind: str
    size: Values
    T_world: Pose
    corners: Places
    piece: MeshPiece | None
    colour: Colour | None
    tile: GroundTile | None = None

    @property
    def mjcf_attributes(self) -> dict[str, str | NDArray[np.float64]]:
        """MJCF attributes for the solid's type and its pose in the world."""
        R, position = self.T_world[:3, :3], self.T_world[:3, 3]
        return {"type": self.kind, "pos": position, "quat": Rotation.from_matrix(R).as_quat(scalar_first=True)}


class SolidReader:
    """Converts shapes to solids; each mesh is cut into pieces only once."""

    def __init__(self, meshes: Meshes):
        """``meshes``: meshes of the world."""
        self._files = meshes
        self._pieces: dict[object, list[MeshPiece]] = {}

    def solids(self, shape: SdfShape) -> Iterator[Solid]:
        """Yield the solids of a shape; InputError if a number is invalid, or a file is missing or broken."""
        for form in shape.geometry:
            if form.tag in _PRIMITIVES:
                yield _PRIMITIVES[form.tag](form, shape)
            elif form.tag == "mesh":
                yield from self._meshes(form, shape)
            elif form.tag == "polyline":
                yield from self._extruded(shape)
                return  # all outlines form one body
            elif form.tag == "heightmap":
                for tile in tiles_of(form, shape.T_world, shape.base, self._files.resources, shape.where):
                    yield _height_field(tile, shape.colour)
            elif form.tag not in (*LEFT_OUT, "empty"):
                raise InputError(f"{shape.where}: the geometry <{form.tag[:40]}> is not supported")

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
                raise InputError(
                    f"{shape.where}: {path} extends more than {FARTHEST:g} m from its origin; check <scale>"
                )
            self._pieces[key] = [piece for surface in scaled for piece in pieces_of(surface)]
        for piece in self._pieces[key]:
            yield Solid("mesh", np.zeros(0), shape.T_world, piece.vertices, piece, shape.colour or piece.colour)

    def _extruded(self, shape: SdfShape) -> Iterator[Solid]:
        outlines, height = [], 1.0
        for form in shape.geometry.findall("polyline"):
            outlines.append(np.array([numbers(p.text, 2, f"{shape.where}, <point>") for p in form.findall("point")]))
            height = float(child_numbers(form, "height", (1.0,), shape.where)[0])
        if min(map(len, outlines)) < 3 or height <= 0:
            found = f"(found {min(map(len, outlines))}) and a <height> above 0 (found {height:g})"
            raise InputError(f"{shape.where}: a <polyline> must have at least 3 points {found}")
        try:
            piece = extruded(outlines, height)
        except ValueError as error:
            raise InputError(f"{shape.where}: {' '.join(str(error).split())}") from error
        yield Solid("mesh", np.zeros(0), shape.T_world, piece.vertices, piece, shape.colour)


def _scaled(surfaces: list[MeshSurface], scale: NDArray[np.float64], centred: bool) -> Iterator[MeshSurface]:
    """Scale surfaces along the axes; if ``centred``, first move the centre of their joint bounding box to 0."""
    every = np.concatenate([s.vertices for s in surfaces])
    middle = (every.min(axis=0) + every.max(axis=0)) / 2 if centred else np.zeros(3)
    order = 1 if np.prod(scale) > 0 else -1  # a mirror image turns triangles inside out
    for s in surfaces:
        yield MeshSurface(s.name, (s.vertices - middle) * scale, s.triangles[:, ::order], s.colour)


def _sizes(form: "Element", tags: dict[str, tuple[float, ...]], where: str) -> Values:
    """Sizes of a form, m, from child elements with defaults; InputError if a size is invalid or negative."""
    values = np.concatenate([child_numbers(form, tag, default, where) for tag, default in tags.items()])
    if (values < 0).any():
        raise InputError(f"{where}: the sizes of <{form.tag}> must be non-negative, not {values.min():g}")
    return values


def _box(form: "Element", shape: SdfShape) -> Solid:
    half = np.maximum(_sizes(form, {"size": (1.0, 1.0, 1.0)}, shape.where) / 2, MIN_HALF_SIZE)
    return Solid("box", half, shape.T_world, CUBE * half, None, shape.colour)


def _cylinder_or_capsule(kind: str, form: "Element", shape: SdfShape) -> Solid:
    """A cylinder or a capsule; the length of a capsule does not include its round ends."""
    sizes = _sizes(form, {"radius": (1.0,), "length": (1.0,)}, shape.where) * (1.0, 0.5)
    radius, half = np.maximum(sizes, MIN_HALF_SIZE)
    reach = half + radius * (kind == "capsule")
    corners = swept(np.array([(radius, -reach), (radius, reach)]), SEGMENTS)
    return Solid(kind, np.array([radius, half]), shape.T_world, corners, None, shape.colour)


def _cone(form: "Element", shape: SdfShape) -> Solid:
    radius, length = np.maximum(_sizes(form, {"radius": (0.5,), "length": (1.0,)}, shape.where), MIN_HALF_SIZE)
    corners = np.vstack([swept(np.array([(radius, -length / 2)]), SEGMENTS), [(0, 0, length / 2)]])
    piece = MeshPiece(corners, np.zeros((0, 3), np.int64), [corners], shape.colour)
    return Solid("mesh", np.zeros(0), shape.T_world, corners, piece, shape.colour)


def _sphere_or_ellipsoid(kind: str, tag: str, default: tuple[float, ...], form: "Element", shape: SdfShape) -> Solid:
    radii = np.maximum(_sizes(form, {tag: default}, shape.where), MIN_HALF_SIZE)
    latitude = np.linspace(-np.pi / 2, np.pi / 2, SEGMENTS // 2 + 1)
    corners = swept(np.stack([np.cos(latitude), np.sin(latitude)], axis=1), SEGMENTS) * radii
    return Solid(kind, radii, shape.T_world, corners, None, shape.colour)


def _height_field(tile: GroundTile, colour: Colour | None) -> Solid:
    low, high = float(tile.heights.min()), float(tile.heights.max())
    size = np.array([*tile.half, max(high - low, MIN_HALF_SIZE), BASE_THICKNESS])
    T = tile.T_world @ from_rotation(np.eye(3), (0.0, 0.0, low))
    return Solid("hfield", size, T, tile.corners - (0.0, 0.0, low), None, colour, tile)


def _plane(form: "Element", shape: SdfShape) -> Solid:
    """An infinite plane if it is level and faces up, otherwise a plate of the size in the file."""
    normal = child_numbers(form, "normal", (0.0, 0.0, 1.0), shape.where)
    if not normal.any():
        raise InputError(f"{shape.where}: the <normal> of a <plane> must not be the zero vector")
    try:
        half = np.maximum(_sizes(form, {"size": (1.0, 1.0)}, shape.where) / 2, MIN_HALF_SIZE)
    except InputError:  # for example, if the size is too large; the plane is then infinite
        half = np.full(2, INFINITE_PLANE_HALF_SIZE)
    z = normal / np.linalg.norm(normal)
    x = np.cross([0.0, 1.0, 0.0], z) if abs(z[1]) < 0.9 else np.cross([0.0, 0.0, 1.0], z)
    x /= np.linalg.norm(x)
    T = shape.T_world @ from_rotation(np.column_stack([x, np.cross(z, x), z]), np.zeros(3))
    if T[2, 2] > 1 - LEVEL_TOLERANCE:
        return Solid("plane", np.array([*half, GRID_SPACING]), T, SQUARE * [*half, 0], None, shape.colour)
    size = np.array([*half, PLATE_HALF_THICKNESS])
    behind = T @ from_rotation(np.eye(3), (0.0, 0.0, -PLATE_HALF_THICKNESS))
    return Solid("box", size, behind, CUBE * size, None, shape.colour)


_PRIMITIVES: dict[str, Callable[..., Solid]] = {
    "box": _box,
    "cylinder": partial(_cylinder_or_capsule, "cylinder"),
    "capsule": partial(_cylinder_or_capsule, "capsule"),
    "cone": _cone,
    "sphere": partial(_sphere_or_ellipsoid, "sphere", "radius", (1.0,)),
    "ellipsoid": partial(_sphere_or_ellipsoid, "ellipsoid", "radii", (1.0, 1.0, 1.0)),
    "plane": _plane,
}
