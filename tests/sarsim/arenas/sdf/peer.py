"""A second reader of plain SDF worlds and of COLLADA, which shares no code with the first: its numbers are compared.

It knows models, links and their collision shapes, includes by folders beside the world, the first state, and meshes
of one node with a matrix.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from lxml import etree

SPACE = "{http://www.collada.org/2005/11/COLLADASchema}"
SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}


class Shape(NamedTuple):
    """A shape: of which kind, its 4×4 pose, and its numbers in m or, of a mesh, its vertices (N, 3) in the world."""

    kind: str
    T: np.ndarray
    numbers: np.ndarray


def shapes_of(path: Path) -> Iterator[Shape]:
    """All shapes of a world but planes."""
    world = _root(path).find("world")
    state = {e.get("name"): e for e in world.iterfind("state[1]/model")}
    for child in world:
        if child.tag == "model":
            yield from _model(child, child, path.parent, path.parent, state.get(child.get("name")))
        elif child.tag == "include":
            name = child.findtext("uri").removeprefix("model://")
            for folder in (path.parent / name, path.parent / "models" / name):
                if (folder / "model.sdf").exists():
                    model = _root(folder / "model.sdf").find("model")
                    placed = child if child.find("pose") is not None else model
                    yield from _model(model, placed, folder, path.parent, None)


def _root(path: Path):
    """The root of a file, whose XML may be a little broken."""
    return etree.fromstring(path.read_bytes(), etree.XMLParser(recover=True, resolve_entities=False))


def _model(model, placed, folder, home, state) -> Iterator[Shape]:
    T_model = _pose((placed if state is None else state).findtext("pose"))
    for link in model.iterfind("link"):
        T_link = T_model @ _pose(link.findtext("pose"))
        moved = None if state is None else state.find(f"link[@name='{link.get('name')}']")
        if moved is not None:
            T_link = _pose(moved.findtext("pose"))
        for collision in link.iterfind("collision"):
            T = T_link @ _pose(collision.findtext("pose"))
            if not np.abs(T[:3, 3]).max() < 8192:
                continue  # thrown out of the world
            for form in collision.find("geometry"):
                if form.tag in SIZES:
                    words = " ".join(form.findtext(tag) for tag in SIZES[form.tag]).split()
                    yield Shape(form.tag, T, np.array(words, float))
                elif form.tag == "mesh":
                    file = form.findtext("uri").partition("://")[2]
                    file = next((f for f in (home / file, folder / file, home / "models" / file) if f.exists()), None)
                    if file is not None:
                        scale = np.array((form.findtext("scale") or "1 1 1").split(), float)
                        vertices = _collada(file) * scale
                        yield Shape("mesh", T, vertices @ T[:3, :3].T + T[:3, 3])


def _pose(text: str | None) -> np.ndarray:
    x, y, z, roll, pitch, yaw = map(float, (text or "0 0 0 0 0 0").split())
    (a, b, c), (p, q, r) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    T = np.eye(4)
    T[:3, :3] = [
        (b * c, p * q * c - a * r, a * q * c + p * r),
        (b * r, p * q * r + a * c, a * q * r - p * c),
        (-q, p * b, a * b),
    ]
    T[:3, 3] = x, y, z
    return T


def _collada(path: Path) -> np.ndarray:
    """(N, 3) m, the corners of the faces of every mesh that a node of the scene shows."""
    root = _root(path)
    unit = root.find(f"{SPACE}asset/{SPACE}unit")
    found = []
    for node in root.iterfind(f".//{SPACE}visual_scene/{SPACE}node"):
        for instance in node.iterfind(f"{SPACE}instance_geometry"):
            mesh = root.find(f".//{SPACE}geometry[@id='{instance.get('url')[1:]}']/{SPACE}mesh")
            matrix = np.array((node.findtext(f"{SPACE}matrix") or "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1").split(), float)
            points = _points(mesh) @ matrix.reshape(4, 4)[:3, :3].T + matrix.reshape(4, 4)[:3, 3]
            found.append(points[np.unique(_corners(mesh))])
    return np.concatenate(found) * float(1 if unit is None else unit.get("meter", 1))


def _points(mesh) -> np.ndarray:
    source = mesh.find(f"{SPACE}vertices/{SPACE}input[@semantic='POSITION']").get("source")[1:]
    numbers = mesh.find(f"{SPACE}source[@id='{source}']/{SPACE}float_array").text.split()
    return np.array(numbers, float).reshape(-1, 3)


def _corners(mesh) -> np.ndarray:
    faces = []
    for part in (*mesh.iterfind(f"{SPACE}polylist"), *mesh.iterfind(f"{SPACE}triangles")):
        inputs = part.findall(f"{SPACE}input")
        offset = next(int(i.get("offset")) for i in inputs if i.get("semantic") == "VERTEX")
        stride = 1 + max(int(i.get("offset")) for i in inputs)
        faces.append(np.array(part.findtext(f"{SPACE}p").split(), int)[offset::stride])
    return np.concatenate(faces)
