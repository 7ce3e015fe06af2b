"""Triangles from mesh files: STL and OBJ by trimesh, COLLADA by pycollada, both in Python: a broken file raises."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import collada
import numpy as np
import trimesh
from defusedxml import ElementTree
from numpy.typing import NDArray

from pipeline.arrays import Places
from pipeline.errors import InputError
from sarsim.arenas.sdf.colours import Colour
from sarsim.arenas.sdf.resources import Resources
from sarsim.vetting.model_files import RefusedError

MOST_TRIANGLES = 500_000  # of a mesh; finding its connected pieces takes 10 µs each


@dataclass(frozen=True, eq=False)
class MeshSurface:
    """Triangles of one name and colour.

    Attributes:
        name: of the part of the file, by which ``<submesh>`` chooses it.
        vertices: (N, 3) float64 m.
        triangles: (M, 3) int64 indices of vertices, counter-clockwise from outside.
        colour: None if the file gives none.
    """

    name: str
    vertices: Places
    triangles: NDArray[np.int64]
    colour: Colour | None = None


class Meshes:
    """The mesh files of a world, each read once.

    Attributes:
        resources: the world's files.
    """

    def __init__(self, resources: Resources):
        self.resources = resources
        self._read: dict[Path, list[MeshSurface] | str] = {}

    def surfaces(self, path: Path) -> list[MeshSurface]:
        """The surfaces of a mesh file (:func:`read_surfaces`), or the InputError that says what is wrong with it."""
        if path not in self._read:
            try:
                self._read[path] = read_surfaces(self.resources, path)
            except RefusedError:
                raise
            except InputError as error:
                self._read[path] = str(error)
        read = self._read[path]
        if isinstance(read, str):
            raise InputError(read)
        return read


def read_surfaces(resources: Resources, path: Path) -> list[MeshSurface]:
    """The surfaces of a mesh file, in m, as Gazebo has them.

    Raises:
        InputError: it is of another kind, cannot be read, or has too many triangles or none.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: not a mesh that is read: {', '.join(_READERS)}")
    content = resources.read(path)
    if reader is _collada:
        content = ElementTree.tostring(resources.parse(path))  # without entities
    try:
        surfaces = [s for s in reader(content, path.suffix.lower()[1:]) if len(s.triangles)]
    except Exception as error:  # of many kinds, on broken files
        said = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(f"{path}: not a readable mesh: {said}") from error
    count = sum(len(s.triangles) for s in surfaces)
    if not 0 < count <= MOST_TRIANGLES:
        raise InputError(f"{path}: {count} triangles; from 1 to {MOST_TRIANGLES} are read")
    if not all(np.isfinite(s.vertices).all() for s in surfaces):
        raise InputError(f"{path}: a vertex is not finite")
    return surfaces


def _trimesh(content: bytes, kind: str) -> Iterator[MeshSurface]:
    """STL and OBJ, which have no unit: m. Materials and textures are not read."""
    scene: Any = trimesh.load_scene(BytesIO(content), file_type=kind, skip_materials=True, process=False)
    for name, mesh in scene.geometry.items():
        yield MeshSurface(name, np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64))


def _collada(content: bytes, kind: str) -> Iterator[MeshSurface]:
    """COLLADA: the visual scene, with its nodes' transforms and its unit.

    ``<up_axis>`` turns nothing: Gazebo does not read it, and its worlds are made to look right there.
    """
    file = collada.Collada(BytesIO(content), ignore=[collada.common.DaeError])
    unit = file.assetInfo.unitmeter or 1.0
    for geometry in file.scene.objects("geometry"):
        for primitive in geometry.primitives():
            if isinstance(primitive, collada.triangleset.BoundTriangleSet):
                triangles = primitive
            elif hasattr(primitive, "triangleset"):
                triangles = primitive.triangleset()
            else:
                continue  # lines
            vertices = np.asarray(triangles.vertex, np.float64) * unit
            name = geometry.original.name or geometry.original.id
            yield MeshSurface(
                name, vertices, np.asarray(triangles.vertex_index, np.int64), _diffuse(primitive.material)
            )


def _diffuse(material: Any) -> Colour | None:
    """The diffuse colour of a COLLADA material; None if it is a texture."""
    value = getattr(getattr(material, "effect", None), "diffuse", None)
    if not isinstance(value, tuple) or len(value) < 3:
        return None
    red, green, blue = np.clip(np.array(value[:3], np.float64), 0.0, 1.0).tolist()
    return red, green, blue


_READERS: dict[str, Callable[[bytes, str], Iterator[MeshSurface]]] = {
    ".stl": _trimesh, ".obj": _trimesh, ".dae": _collada,
}  # fmt: skip
