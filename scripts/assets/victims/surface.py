"""The surface of a person around the CMU humanoid's skeleton, as a level set of soft primitives.

Positions are in the frame of the humanoid's root, m: x to its left, y up, z forward. At rest, the arms are stretched
out to the sides and the legs are 40° apart. Primitives of the left side are mirrored to the right.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from sarsim.victims.people import NECK

Points = NDArray[np.float64]

SOFTNESS = 0.011  # Distance over which primitives, and bone weights at a joint, blend into each other, m
GRID = 0.009  # Spacing of the samples of the level set, m
HEAD_SCALE = {"man": 1.0, "woman": 0.98, "stout": 1.0, "child": 1.3}
HIP, KNEE, ANKLE = np.array([(0.122, -0.11, 0.05), (0.289, -0.567, 0.059), (0.452, -1.015, 0.05)])


@dataclass(frozen=True, eq=False)
class Primitive:
    """A soft shape that belongs to a bone.

    Attributes:
        bone: name of the humanoid's body to which it is attached.
        centre: (3,) centre of an ellipsoid, or (2, 3) ends of a cone, m.
        radii: (3,) semi-axes of the ellipsoid along x, y, z, or (2,) radii of the cone at its ends, m.
    """

    bone: str
    centre: NDArray[np.float64]
    radii: NDArray[np.float64]

    def distance(self, points: Points) -> NDArray[np.float64]:
        """(N,) approximate signed distance of points from the surface, m, positive outside."""
        return (_cone if self.centre.ndim == 2 else _ellipsoid)(points, self.centre, self.radii)

    def mirrored(self) -> "Primitive":
        """The mirror image of a left primitive on the right side of the body."""
        return replace(self, bone="r" + self.bone[1:], centre=self.centre * [-1, 1, 1])


@dataclass(frozen=True, eq=False)
class Surface:
    """A closed surface on a skeleton.

    Attributes:
        vertices: (N, 3) m, at rest.
        faces: (M, 3) indices of vertices, counter-clockwise from outside.
        weights: (N, B) skinning weight of each bone for each vertex; rows sum to 1.
        bones: names of the bones.
    """

    vertices: Points
    faces: NDArray[np.int64]
    weights: NDArray[np.float64]
    bones: tuple[str, ...]


def person(build: str) -> list[Primitive]:
    """The primitives of a man, a woman, a stout person or a child, all around the same skeleton."""
    slim = {"man": 1.0, "woman": 0.88, "stout": 1.12, "child": 0.95}[build]
    middle = [
        _ball("root", (0, -0.065, 0.012), (0.175, 0.125, 0.122)),
        _ball("lowerback", (0, 0.06, 0.012), (0.162, 0.13, 0.112)),
        _ball("upperback", (0, 0.20, 0.012), (0.172, 0.14, 0.12)),
        _ball("thorax", (0, 0.355, 0.008), (0.19, 0.16, 0.128)),
        _stick("lowerneck", [(0, 0.45, -0.012), (0, 0.56, 0.0)], (0.085, 0.062)),
        _stick("upperneck", [(0, 0.55, 0.0), (0, 0.67, 0.01)], (0.06, 0.058)),
        *_head(),
    ]
    left = [*_arm(slim), *_hand(), *_leg(slim), *_foot()]
    if build == "woman":
        middle[0] = _ball("root", (0, -0.075, 0.012), (0.182, 0.125, 0.12))
        middle[1] = _ball("lowerback", (0, 0.06, 0.012), (0.14, 0.13, 0.096))
        middle[2] = _ball("upperback", (0, 0.20, 0.01), (0.15, 0.14, 0.106))
        middle[3] = _ball("thorax", (0, 0.35, 0.005), (0.17, 0.16, 0.112))
        left.append(_ball("lthorax", (0.074, 0.29, 0.09), (0.062, 0.06, 0.056)))
    if build == "stout":
        middle.append(_ball("lowerback", (0, 0.07, 0.06), (0.195, 0.17, 0.145)))
    primitives = [_unsided(p) for p in middle + left + [p.mirrored() for p in left]]
    return [_grown(p, HEAD_SCALE[build]) if p.bone == "head" else p for p in primitives]


def scaled_head(points: Points, share: NDArray[np.float64] | float, scale: float) -> Points:
    """Points scaled by ``scale`` about the neck, in proportion to the head's skinning weight ``share`` for each."""
    return points + np.expand_dims(share, -1) * (scale - 1) * (points - NECK)


def hair(style: str) -> Callable[[Points], NDArray[np.float64]]:
    """Signed distance function of hair: short, or long down to the neck."""
    cap = _ball("head", (0, 0.778, 0.004), (0.098, 0.112, 0.118))
    fall = _ball("head", (0, 0.70, -0.045), (0.105, 0.15, 0.08))

    def distance(points: Points) -> NDArray[np.float64]:
        _, y, z = points.T
        hairline = (z - 0.075) * 0.75 - (y - 0.815) * 0.66  # negative behind and above the forehead
        crown = np.maximum(cap.distance(points), np.maximum(hairline, 0.735 - y - 0.9 * np.maximum(-z, 0)))
        if style == "short":
            return crown
        return np.minimum(crown, np.maximum(fall.distance(points), hairline))

    return distance


def body_surface(primitives: list[Primitive], triangles: int) -> Surface:
    """The surface of the primitives' soft union, with about ``triangles`` triangles."""
    bones = tuple(dict.fromkeys(p.bone for p in primitives))
    vertices, faces = level_set(lambda p: soft_union(primitives, p), triangles)
    return Surface(vertices, faces, _weights(primitives, bones, vertices), bones)


def soft_union(primitives: list[Primitive], points: Points) -> NDArray[np.float64]:
    """(N,) approximate signed distance to the union of primitives, rounded where they meet, m."""
    total = np.zeros(len(points))
    for primitive in primitives:
        total += np.exp(-np.clip(primitive.distance(points), -0.5, 0.5) / SOFTNESS)
    return -SOFTNESS * np.log(total)


def fitted(primitives: list[Primitive], vertices: Points) -> Points:
    """Vertices moved along the gradient onto the surface of the primitives' soft union."""
    for _ in range(4):
        step = 1e-4
        value = soft_union(primitives, vertices)
        slope = np.stack(
            [(soft_union(primitives, vertices + step * axis) - value) / step for axis in np.eye(3)], axis=1
        )
        vertices = vertices - slope * (value / np.maximum((slope**2).sum(axis=1), 0.25))[:, None]
    return vertices


def level_set(distance: Callable[[Points], NDArray[np.float64]], triangles: int) -> tuple[Points, NDArray[np.int64]]:
    """Vertices and faces of the surface where ``distance`` is 0, with about ``triangles`` triangles.

    Naive surface nets: one vertex in each cell and one quad for each cell edge that the surface crosses.
    """
    low, high = np.array([-1.12, -1.14, -0.2]), np.array([1.12, 0.93, 0.36])
    axes = [np.arange(a, b, GRID) for a, b in zip(low, high, strict=True)]
    slabs = (np.stack(np.meshgrid([x], *axes[1:], indexing="ij"), axis=-1) for x in axes[0])
    values = np.concatenate([distance(slab.reshape(-1, 3)) for slab in slabs])
    vertices, faces = _surface_net(values.reshape([len(axis) for axis in axes]))
    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(vertices * GRID + low), o3d.utility.Vector3iVector(faces)
    )
    mesh = mesh.filter_smooth_taubin(5).simplify_quadric_decimation(triangles)
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles, np.int64)


def _surface_net(values: NDArray[np.float64]) -> tuple[Points, NDArray[np.int64]]:
    """Vertices, in units of ``GRID``, and triangles."""
    inside = values < 0
    index = np.full(np.array(values.shape) - 1, -1)
    total, count = np.zeros((*index.shape, 3)), np.zeros(index.shape)
    for axis in range(3):
        for corner in np.ndindex(2, 2):
            start = np.insert(corner, axis, 0)
            a = _corner(values, start)
            b = _corner(values, start + np.eye(3, dtype=int)[axis])
            crossed = (a < 0) != (b < 0)
            t = np.divide(a, a - b, out=np.zeros_like(a), where=crossed)
            place = np.broadcast_to(start.astype(float), (*a.shape, 3)).copy()
            place[..., axis] += t
            total += place * crossed[..., None]
            count += crossed
    cells = np.argwhere(count > 0)
    index[tuple(cells.T)] = np.arange(len(cells))
    vertices = cells + total[tuple(cells.T)] / count[tuple(cells.T)][:, None]
    return vertices, np.concatenate([_quads(inside, index, axis) for axis in range(3)])


def _quads(inside: NDArray[np.bool_], index: NDArray[np.int64], axis: int) -> NDArray[np.int64]:
    """Two triangles for each grid edge along ``axis`` that the surface crosses."""
    before, after = np.moveaxis(inside, axis, 0)[:-1], np.moveaxis(inside, axis, 0)[1:]
    turned = np.moveaxis(index, axis, 0)
    edges = np.argwhere(before != after)
    i, j, k = edges[np.all(edges[:, 1:] > 0, axis=1)].T
    quad = np.stack([turned[i, j - 1, k - 1], turned[i, j, k - 1], turned[i, j, k], turned[i, j - 1, k]], axis=1)
    flip = before[i, j, k] == (axis == 1)
    quad[flip] = quad[flip][:, ::-1]
    return np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])


def _corner(values: NDArray[np.float64], start: NDArray[np.int64]) -> NDArray[np.float64]:
    n = np.array(values.shape) - 1
    return values[tuple(slice(s, s + m) for s, m in zip(start, n, strict=True))]


def _weights(primitives: list[Primitive], bones: tuple[str, ...], vertices: Points) -> NDArray[np.float64]:
    """(N, B) skinning weights of the bones: the contribution of their primitives to the soft union."""
    weights = np.zeros((len(vertices), len(bones)))
    for primitive in primitives:
        weights[:, bones.index(primitive.bone)] += np.exp(-primitive.distance(vertices) / SOFTNESS)
    weights[weights < 0.02 * weights.max(axis=1, keepdims=True)] = 0
    return weights / weights.sum(axis=1, keepdims=True)


def _head() -> list[Primitive]:
    return [
        _ball("head", (0, 0.775, 0.012), (0.085, 0.098, 0.104)),
        _ball("head", (0, 0.695, 0.05), (0.066, 0.08, 0.066)),
        _stick("head", [(-0.012, 0.632, 0.082), (0.012, 0.632, 0.082)], (0.024, 0.024)),
        _stick("head", [(0, 0.752, 0.112), (0, 0.71, 0.134)], (0.007, 0.016)),
        _ball("lhead", (0.09, 0.72, 0.01), (0.01, 0.032, 0.02)),
        _ball("rhead", (-0.09, 0.72, 0.01), (0.01, 0.032, 0.02)),
    ]


def _arm(slim: float) -> list[Primitive]:
    y, z = 0.514, 0.008
    return [
        _stick("lclavicle", [(0.06, 0.45, -0.01), (0.19, 0.495, 0.0)], (0.08, 0.072 * slim)),
        _stick("lclavicle", [(0.03, 0.54, -0.03), (0.16, 0.52, -0.01)], (0.05, 0.05)),
        _stick("lhumerus", [(0.205, 0.508, 0.005), (0.36, y, z)], (0.07 * slim, 0.056 * slim)),
        _stick("lhumerus", [(0.36, y, z), (0.55, y, z)], (0.055 * slim, 0.045 * slim)),
        _stick("lradius", [(0.55, y, z), (0.63, y, z)], (0.045 * slim, 0.047 * slim)),
        _stick("lradius", [(0.63, y, z), (0.765, y, z)], (0.046 * slim, 0.033 * slim)),
        _stick("lwrist", [(0.765, y, z), (0.87, y, z)], (0.033 * slim, 0.027 * slim)),
    ]


def _hand() -> list[Primitive]:
    y = 0.514
    fingers = [
        _stick("lfingers", [(0.955, y, z), (0.955 + length, y, z)], (0.0095, 0.007))
        for z, length in ((-0.026, 0.075), (-0.004, 0.092), (0.018, 0.097), (0.04, 0.085))
    ]
    return [
        _ball("lhand", (0.912, y, 0.008), (0.058, 0.015, 0.042)),
        *fingers,
        _stick("lthumb", [(0.893, y - 0.004, 0.045), (0.95, y - 0.006, 0.082)], (0.013, 0.009)),
    ]


def _leg(slim: float) -> list[Primitive]:
    along = (ANKLE - KNEE) / np.linalg.norm(ANKLE - KNEE)
    calf = KNEE + 0.15 * along + [0, 0, -0.022]
    return [
        _ball("lfemur", (0.1, -0.135, -0.035), (0.092, 0.1, 0.088)),
        _stick("lfemur", [HIP, 0.4 * HIP + 0.6 * KNEE], (0.106 * slim, 0.088 * slim)),
        _stick("lfemur", [0.4 * HIP + 0.6 * KNEE, KNEE], (0.087 * slim, 0.063 * slim)),
        _stick("ltibia", [KNEE, calf], (0.061 * slim, 0.066 * slim)),
        _stick("ltibia", [calf, ANKLE], (0.065 * slim, 0.044 * slim)),
    ]


def _foot() -> list[Primitive]:
    return [
        _stick("lfoot", [(0.455, -1.04, 0.02), (0.462, -1.035, 0.07)], (0.046, 0.05)),
        _stick("lfoot", [(0.462, -1.05, 0.08), (0.475, -1.066, 0.2)], (0.044, 0.036)),
        _ball("ltoes", (0.477, -1.073, 0.24), (0.047, 0.03, 0.07)),
    ]


def _grown(primitive: Primitive, scale: float) -> Primitive:
    return replace(primitive, centre=scaled_head(primitive.centre, 1.0, scale), radii=primitive.radii * scale)


def _ball(bone: str, centre: tuple[float, float, float], radii: tuple[float, float, float]) -> Primitive:
    return Primitive(bone, np.array(centre, float), np.array(radii))


def _stick(bone: str, ends: object, radii: tuple[float, float]) -> Primitive:
    return Primitive(bone, np.array(ends, float), np.array(radii))


def _unsided(primitive: Primitive) -> Primitive:
    """The primitive on its unpaired bone: ears and breasts come in pairs, but the head and thorax do not."""
    bone = primitive.bone
    return replace(primitive, bone=bone[1:]) if bone[1:] in ("head", "thorax") else primitive


def _ellipsoid(points: Points, centre: Points, radii: NDArray[np.float64]) -> NDArray[np.float64]:
    """Approximate signed distance to an ellipsoid after Quilez: https://iquilezles.org/articles/ellipsoids."""
    offset = points - centre
    k0 = np.linalg.norm(offset / radii, axis=1)
    k1 = np.linalg.norm(offset / radii**2, axis=1)
    return k0 * (k0 - 1) / np.maximum(k1, 1e-9)


def _cone(points: Points, ends: Points, radii: NDArray[np.float64]) -> NDArray[np.float64]:
    """Approximate signed distance to a round cone: spheres along a segment with linearly changing radius."""
    axis = ends[1] - ends[0]
    t = np.clip((points - ends[0]) @ axis / (axis @ axis), 0, 1)
    return np.linalg.norm(points - ends[0] - t[:, None] * axis, axis=1) - radii[0] - t * (radii[1] - radii[0])
