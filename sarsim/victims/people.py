"""The library of people, ``assets/victims/people.npz``: bodies, and poses in which bodies came to rest.

The surfaces of the bodies lie around the bones of dm_control's CMU humanoid, which was dropped as a ragdoll.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from pipeline.arrays import Indices, Place, Places, Rotation3
from sarsim.assets import asset
from sarsim.victims.mjcf import about_z

VERTEX_UNIT = 1e-4  # m; vertices are stored as integer multiples of this
LIBRARY_STATURE = 2.01  # Stature of the library's people, m
NECK = np.array([0, 0.63, 0.01])  # m, at rest; the point about which a child's larger head is scaled
CHIN = np.array([[0, 0.6, 0.03]])  # m, at rest; between head and chest
AGAINST_WALL = ("sitting", "slumped", "seated")  # The postures in which a wall at x = 0 holds the person up


@dataclass(frozen=True, eq=False)
class Shape:
    """A triangle mesh.

    Attributes:
        vertices: (N, 3) m, corners of the faces.
        faces: (M, 3) indices of vertices, counter-clockwise from outside.
    """

    vertices: Places
    faces: NDArray[np.int64]

    def moved(self, R: Rotation3, shift: Place) -> "Shape":
        """The shape rotated about the origin by ``R`` (3, 3), then shifted by ``shift`` (3,) m."""
        return Shape(self.vertices @ R.T + shift, self.faces)


@dataclass(frozen=True, eq=False)
class Figure:
    """A person in a posture, in the victim's own frame.

    Attributes:
        body: the whole surface without the hair.
        rest: (N, 3) m, the body's vertices at rest, with the arms stretched out; x points to the left and y up.
        face_parts: (M,) index into ``parts`` for each face of the body.
        parts: names of the parts.
        hair: surface of the hair by style.
        head_rotation: (3, 3) rotation of the head from rest to the posture.
        head_offset: (3,) m, translation of the head from rest to the posture.
        head_scale: size of the head relative to an adult's.
        scale: ratio of the person's stature to ``LIBRARY_STATURE``.
    """

    body: Shape
    rest: Places
    face_parts: Indices
    parts: tuple[str, ...]
    hair: dict[str, Shape]
    head_rotation: Rotation3
    head_offset: Place
    head_scale: float
    scale: float

    def on_head(self, points: Places) -> Places:
        """(N, 3) m, points on an adult's head at rest, mapped to this person's head in the posture."""
        grown = points + (self.head_scale - 1) * (points - NECK)
        return self.scale * grown @ self.head_rotation.T + self.head_offset

    def visible_vertices(self, hair_style: str) -> Places:
        """(N, 3) m, vertices of the body, and of the hair if there is any."""
        shown = self.body.vertices[np.unique(self.body.faces)]
        return np.concatenate([shown, self.hair[hair_style].vertices]) if hair_style in self.hair else shown

    def only(self, parts: tuple[str, ...]) -> "Figure":
        """The person reduced to some parts; holes left by the removed parts are closed."""
        kept = np.isin(self.face_parts, [self.parts.index(part) for part in parts])
        index = np.array([parts.index(p) if p in parts else 0 for p in self.parts])
        body, face_parts = self.body.faces[kept], index[self.face_parts[kept]]
        vertices, rest = self.body.vertices, self.rest
        for face, corners in _holes(body):
            cap = np.stack([corners[:, 1], corners[:, 0], np.full(len(corners), len(vertices))], axis=1)
            body = np.concatenate([body, cap])
            face_parts = np.append(face_parts, np.full(len(cap), face_parts[face]))
            vertices, rest = (np.vstack([v, v[corners[:, 0]].mean(axis=0)]) for v in (vertices, rest))
        return replace(self, body=Shape(vertices, body), rest=rest, face_parts=face_parts, parts=parts)

    def moved(self, yaw: float, shift: Place) -> "Figure":
        """The person rotated about z by ``yaw`` rad, then shifted by ``shift`` (3,) m."""
        R = about_z(yaw)
        return replace(
            self,
            body=self.body.moved(R, shift),
            hair={style: shape.moved(R, shift) for style, shape in self.hair.items()},
            head_rotation=R @ self.head_rotation,
            head_offset=R @ self.head_offset + shift,
        )

    def centred(self) -> "Figure":
        """The person shifted horizontally to be centred at the origin, and vertically to rest on the floor."""
        shown = self.visible_vertices("bald")
        low, high = shown.min(axis=0), shown.max(axis=0)
        return self.moved(0, -np.array([*(low + high)[:2] / 2, low[2]]))


class People:
    """The library of people, each with a build and in a posture.

    Attributes:
        postures: (P,) posture of each pose.
        builds: (P,) build of each pose: man, woman, stout or child.
        seat_half_sizes: (3,) m, half sizes of the block on which seated people of stature ``LIBRARY_STATURE`` sit.
    """

    def __init__(self, arrays: dict[str, NDArray]):
        """``arrays``: the arrays in the file, by name."""
        self._arrays = arrays
        self.postures, self.builds = arrays["postures"], arrays["builds"]
        self.seat_half_sizes = arrays["block"]
        self._build_names = list(arrays["build_names"])

    def figure(self, pose: int, stature: float) -> Figure:
        """A person of the given stature, m, in one of the poses."""
        arrays, build = self._arrays, self._build_names.index(self.builds[pose])
        scale, head_scale = stature / LIBRARY_STATURE, float(arrays["head_scales"][build])
        rest = arrays["vertices"][build] * VERTEX_UNIT
        turns, offsets = bone_motions(arrays["rest"], arrays["poses"][pose])
        head = list(arrays["bones"]).index("head")
        moved = scale * skinned(rest, arrays["weights"], turns, offsets)
        body = Shape(self._pressed(moved, pose), arrays["faces"].astype(np.int64))
        parts = tuple(str(part) for part in arrays["parts"])
        figure = Figure(
            body, rest, arrays["face_parts"], parts, {}, turns[head], scale * offsets[head], head_scale, scale
        )
        for style in arrays["hair_styles"]:
            vertices = figure.on_head(arrays[f"{style}_hair_vertices"] * VERTEX_UNIT)
            faces = arrays[f"{style}_hair_faces"].astype(np.int64)
            figure.hair[str(style)] = Shape(self._pressed(vertices, pose), faces)
        return figure

    def _pressed(self, places: NDArray[np.float64], pose: int) -> NDArray[np.float64]:
        """(N, 3) m, points, moved to the surface if inside the floor or, for some postures, the wall at x = 0."""
        wall = 0 if self.postures[pose] in AGAINST_WALL else -np.inf
        return np.maximum(places, [wall, -np.inf, 0])


@cache
def people() -> People:
    """The library of people; its file is read once."""
    with np.load(asset("victims", "people.npz"), allow_pickle=False) as file:
        return People({name: file[name] for name in file.files})


def bone_motions(
    rest: NDArray[np.floating], pose: NDArray[np.floating]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(B, 3, 3) rotations and (B, 3) translations, m, that move bones from rest to a pose.

    ``rest`` and ``pose`` are (B, 7): position, m, and quaternion w x y z.
    """
    before, after = (Rotation.from_quat(p[:, [4, 5, 6, 3]]).as_matrix() for p in (rest, pose))
    turns = after @ before.transpose(0, 2, 1)
    return turns, pose[:, :3] - np.einsum("bij,bj->bi", turns, rest[:, :3])


def skinned(
    vertices: NDArray[np.float64],
    weights: NDArray[np.floating] | NDArray[np.uint8],
    turns: NDArray[np.float64],
    offsets: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(N, 3) m, vertices moved by the weighted mean of their bones' motions (linear blend skinning)."""
    shares = weights / weights.sum(axis=1, keepdims=True, dtype=np.float64)
    moved = np.einsum("bij,nj->nbi", turns, vertices) + offsets
    return np.einsum("nb,nbi->ni", shares, moved)


def vertex_normals(shape: Shape) -> NDArray[np.float64]:
    """(N, 3) outward unit normals: means over the faces around each vertex, weighted by area."""
    a, b, c = (shape.vertices[shape.faces[:, n]] for n in range(3))
    normals = np.zeros_like(shape.vertices)
    np.add.at(normals, shape.faces, np.cross(b - a, c - a)[:, None])
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def _holes(faces: NDArray[np.int64]) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """Yield, for each hole in a surface, an adjacent face and the (K, 2) edges, directed as in the faces."""
    edges = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    rim = np.sort(first[count == 1])
    n = int(faces.max()) + 1
    graph = coo_array((np.ones(len(rim)), edges[rim].T), shape=(n, n))
    loop = connected_components(graph, directed=False)[1][edges[rim, 0]]
    for which in dict.fromkeys(loop.tolist()):
        around = rim[loop == which]
        yield int(around[0]) // 3, edges[around]
