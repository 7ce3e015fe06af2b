"""Reads triangles from mesh files with pycollada or trimesh, in pure Python, so that broken files cause no crash."""

import re
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
from pipeline.transforms import transform_places
from sarsim.arenas.sdf.colours import Colour, Materials, mean_colour, product
from sarsim.arenas.sdf.resources import Resources
from sarsim.vetting.model_files import RefusedError

MAX_TRIANGLES = 500_000  # Maximum number of triangles of a mesh; finding connected pieces takes 10 µs per triangle


@dataclass(frozen=True, eq=False)
class MeshSurface:
    """Triangles with the same name and colour.

    Attributes:
        name: name by which ``<submesh>`` selects these triangles.
        vertices: (N, 3) float64 m, corners of the triangles.
        triangles: (M, 3) int64 indices of vertices, counter-clockwise as seen from outside.
        colour: colour of the triangles; None if the file gives none.
    """

    name: str
    vertices: Places
    triangles: NDArray[np.int64]
    colour: Colour | None = None


class Meshes:
    """The mesh files of a world, each read once.

    Attributes:
        resources: the world's files.
        materials: the colours of the world's materials.
    """

    def __init__(self, resources: Resources):
        self.resources = resources
        self.materials = Materials(resources)
        self._read: dict[Path, list[MeshSurface] | str] = {}

    def surfaces(self, path: Path) -> list[MeshSurface]:
        """The surfaces of a mesh file, as in :func:`read_surfaces`; InputError if the file is invalid."""
        if path not in self._read:
            try:
                self._read[path] = read_surfaces(self.resources, path, self.materials)
            except RefusedError:
                raise
            except InputError as error:
                self._read[path] = str(error)
        read = self._read[path]
        if isinstance(read, str):
            raise InputError(read)
        return read


def read_surfaces(resources: Resources, path: Path, materials: Materials) -> list[MeshSurface]:
    """The surfaces of a mesh file, in m, as Gazebo interprets the file.

    Raises:
        InputError: the file is of an unsupported type or cannot be read, has too many triangles or none, or has a
            vertex that is not finite.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        *most, last = _READERS
        raise InputError(f"{path}: this mesh format is not supported; use {', '.join(most)} or {last}")
    content = resources.read(path)
    if reader is _collada:
        content = ElementTree.tostring(resources.parse(path))  # without entities
    try:
        surfaces = [s for s in reader(content, path, resources, materials) if len(s.triangles)]
    except RefusedError:
        raise
    except Exception as error:  # broken files raise many kinds of exceptions
        said = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(f"{path}: cannot be read as a mesh: {said}") from error
    count = sum(len(s.triangles) for s in surfaces)
    if not 0 < count <= MAX_TRIANGLES:
        raise InputError(f"{path}: the mesh has {count} triangles; it must have from 1 to {MAX_TRIANGLES}")
    if not all(np.isfinite(s.vertices).all() for s in surfaces):
        raise InputError(f"{path}: the coordinates of all vertices must be finite")
    return surfaces


class _MeshFileResolver(trimesh.resolvers.Resolver):
    """Provides trimesh with the files to which a mesh refers."""

    def __init__(self, resources: Resources, path: Path):
        self._resources, self._path = resources, path

    def get(self, name: str) -> bytes:
        """The content of a file; if the file cannot be read, KeyError, by which trimesh recognises a missing file."""
        try:
            path = self._resources.find(name, self._path.parent, str(self._path))
            if path is None or not path.is_file():
                raise KeyError(name)
            return self._resources.read(path)
        except RefusedError:
            raise
        except InputError as error:
            raise KeyError(name) from error

    def keys(self) -> list[str]:
        """An empty list, because files can only be requested by name."""
        return []

    def namespaced(self, namespace: str) -> "_MeshFileResolver":
        """A resolver for a subfolder."""
        return _MeshFileResolver(self._resources, self._path.parent / namespace / self._path.name)

    def write(self, name: str, data: bytes) -> None:
        """Do nothing, because no file may be written."""


def _trimesh(content: bytes, path: Path, resources: Resources, materials: Materials) -> Iterator[MeshSurface]:
    """Yield the surfaces of an STL, OBJ or glTF file, whose coordinates are in m; only OBJ materials are read."""
    kind, is_plain = path.suffix.lower()[1:], path.suffix.lower() != ".obj"
    objects = () if is_plain else {name.decode("utf-8", "replace").strip() for name in _OBJECT.findall(content)}
    options: dict[str, Any] = {"skip_materials": True} if is_plain else {"split_objects": True}
    resolver = _MeshFileResolver(resources, path)
    scene: Any = trimesh.load_scene(BytesIO(content), file_type=kind, resolver=resolver, process=False, **options)
    for node in scene.graph.nodes_geometry:
        T, name = scene.graph[node]
        mesh, named = scene.geometry[name], [o for o in objects if name == o or name.startswith(f"{o}_")]
        vertices = transform_places(T, np.asarray(mesh.vertices, np.float64))
        colour = None if is_plain else _obj_colour(getattr(mesh.visual, "material", None))
        yield MeshSurface(max(named, key=len, default=name), vertices, np.asarray(mesh.faces, np.int64), colour)


def _obj_colour(material: Any) -> Colour | None:
    """The product of an OBJ material's colour ``Kd`` and its texture's mean colour; None if both are missing."""
    if material is None:
        return None
    red, green, blue = (np.asarray(material.diffuse, np.float64)[:3] / 255).tolist()
    written = (red, green, blue) if "kd" in material.kwargs else None
    texture = None if material.image is None else mean_colour(material.image)
    return written if texture is None else product(texture, written or (1.0, 1.0, 1.0))


def _collada(content: bytes, path: Path, resources: Resources, materials: Materials) -> Iterator[MeshSurface]:
    """Yield the surfaces of a COLLADA file's visual scene, in m, with the transforms of its nodes applied.

    ``<up_axis>`` is ignored, as in Gazebo, because worlds are made to look right in Gazebo.
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
            colour = _collada_colour(primitive.material, path.parent, materials)
            yield MeshSurface(name, vertices, np.asarray(triangles.vertex_index, np.int64), colour)


def _collada_colour(material: Any, folder: Path, materials: Materials) -> Colour | None:
    """The diffuse colour of a COLLADA material or its texture's mean colour; None if both are missing."""
    value = getattr(getattr(material, "effect", None), "diffuse", None)
    image = getattr(getattr(getattr(value, "sampler", None), "surface", None), "image", None)
    if image is not None:
        return materials.mean(str(image.path or ""), folder)
    if not isinstance(value, tuple) or len(value) < 3:
        return None
    red, green, blue = np.clip(np.array(value[:3], np.float64), 0.0, 1.0).tolist()
    return red, green, blue


_OBJECT = re.compile(rb"^o[ \t]+(.+)$", re.MULTILINE)
"""The line of an OBJ file that names an object, by which ``<submesh>`` selects it."""
_READERS: dict[str, Callable[[bytes, Path, Resources, Materials], Iterator[MeshSurface]]] = {
    ".stl": _trimesh, ".obj": _trimesh, ".dae": _collada, ".glb": _trimesh, ".gltf": _trimesh,
}  # fmt: skip
