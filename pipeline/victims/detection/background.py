"""The planes that a person lies on, leans against or is seen before."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.frame import Frame
from pipeline.segments.plane import facing_camera

_NEIGHBOURS = 12
"""Samples, of which the nearest one in the image is taken beside another: planes are small, and far apart."""


@dataclass(frozen=True)
class BackgroundConfig:
    """How the planes around a box are looked for.

    Attributes:
        margin: around the box in which they are looked for, as a share of its size.
        min_margin: pixels; the same.
        samples: pixels, about so many, of the box and its margin.
        planes: at most.
        trials: to find each of them.
        min_share: of the samples that a plane must have.
        beyond: samples outside the box, for each inside it, that make a plane more than a part of the person.
        tolerance: m from a plane within which a point belongs to it, over twice the sensor's noise.
        flat: share of a plane's samples that lie within the sensor's noise of it where no one is that flat.
        flat_area: m² across the view of such a plane at least.
    """

    margin: float = 1.0
    min_margin: float = 60.0
    samples: int = 3000
    planes: int = 6
    trials: int = 200
    min_share: float = 0.02
    beyond: float = 0.25
    tolerance: float = 0.012
    flat: float = 0.6
    flat_area: float = 0.04


@dataclass(frozen=True, eq=False)
class _Samples:
    """Some pixels with depth.

    Attributes:
        points: (N, 3) float32 in ``camera_optical``, m.
        pixels: (N, 2) row and column.
        inside: (N,) bool, of the box.
        solid_angle: that each stands for.
    """

    points: NDArray[np.float32]
    pixels: NDArray[np.int64]
    inside: NDArray[np.bool_]
    solid_angle: float

    def __getitem__(self, chosen: NDArray) -> "_Samples":
        return _Samples(self.points[chosen], self.pixels[chosen], self.inside[chosen], self.solid_angle)


def background_planes(
    frame: Frame,
    box: tuple[float, float, float, float],
    config: BackgroundConfig,
    rng: np.random.Generator,
) -> list[NDArray[np.float64]]:
    """(4,) planes [n, d] in and around a box, in ``camera_optical``: see :mod:`pipeline.segments.plane`.

    What RANSAC finds is background if enough of it lies outside the box, or if it is too flat for a person.
    """
    samples, planes = _samples(frame, box, config), []
    enough = max(3, config.min_share * len(samples.points))
    for _ in range(config.planes):
        if len(samples.points) < enough:
            break
        plane = _plane(samples, config, rng)
        near = near_plane(samples.points, plane, config)
        if np.count_nonzero(near) < enough:
            break
        if _goes_on(samples[near], config) or _is_flat(samples[near], plane, config):
            planes.append(plane)
        samples = samples[~near]
    return planes


def _goes_on(plane: _Samples, config: BackgroundConfig) -> bool:
    """Whether enough of a plane lies outside the box."""
    outside = np.count_nonzero(~plane.inside)
    return bool(outside >= config.beyond * np.count_nonzero(plane.inside))


def _is_flat(samples: _Samples, plane: NDArray[np.float64], config: BackgroundConfig) -> bool:
    """Whether samples of a plane are nearer to it than what is round would be."""
    points = samples.points
    near = np.abs(points @ plane[:3] - plane[3]) < 0.002 + depth_noise(points[:, 2])
    area = np.sum(np.square(points[:, 2])) * samples.solid_angle
    return bool(near.mean() >= config.flat and area >= config.flat_area)


def depth_noise(depth: NDArray[np.floating]) -> NDArray[np.floating]:
    """m, standard deviation of a return (Nguyen, Izadi and Lovell, 3DIMPVT 2012)."""
    return 0.0012 + 0.0019 * np.square(depth - 0.4)


def near_plane(
    points: NDArray[np.float32], plane: NDArray[np.float64], config: BackgroundConfig
) -> NDArray[np.bool_]:
    """(N,) bool: which points (N, 3) in ``camera_optical`` belong to a plane (4,)."""
    return np.abs(points @ plane[:3] - plane[3]) < config.tolerance + 2 * depth_noise(points[:, 2])


def _samples(frame: Frame, box: tuple[float, float, float, float], config: BackgroundConfig) -> _Samples:
    """Of a grid over the box and its margin."""
    low, high = np.array(box[:2]), np.array(box[2:])
    margin = config.margin * np.maximum(high - low, config.min_margin)
    size = (frame.intrinsics.width, frame.intrinsics.height)
    first = np.clip(low - margin, 0, size).astype(int)
    last = np.clip(high + margin, 0, size).astype(int)
    stride = max(1, int(np.sqrt(np.prod(last - first) / config.samples)))
    v, u = (axis.ravel() for axis in np.mgrid[first[1] : last[1] : stride, first[0] : last[0] : stride])
    seen = frame.returns[v, u]
    v, u = v[seen], u[seen]
    middle = np.stack([u, v], axis=1) + 0.5
    inside = np.all((middle >= low) & (middle <= high), axis=1)
    k = frame.intrinsics
    points = k.rays[v, u] * frame.depth[v, u, None]
    return _Samples(points, np.stack([v, u], axis=1), inside, stride**2 / (k.fx * k.fy))


def _plane(samples: _Samples, config: BackgroundConfig, rng: np.random.Generator) -> NDArray[np.float64]:
    """(4,) the plane with most samples, fitted to them."""
    planes = _planes_of(_triples(samples, config.trials, rng))
    points = samples.points
    distance = np.abs(points @ planes[:, :3].T.astype(np.float32) - planes[:, 3].astype(np.float32))
    near = distance < (config.tolerance + 2 * depth_noise(points[:, 2]))[:, None]
    best = planes[near.sum(axis=0).argmax()]
    members = samples.points[near_plane(samples.points, best, config)].astype(np.float64)
    if len(members) < 3:
        return best
    centre = members.mean(axis=0)
    normal = np.linalg.svd(members - centre, full_matrices=False)[2][2]
    return facing_camera(np.append(normal, normal @ centre)[None])[0]


def _triples(samples: _Samples, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """(count, 3, 3) points at random, each with two near it in the image."""
    first = rng.integers(len(samples.points), size=count)
    others = rng.integers(len(samples.points), size=(count, 2, _NEIGHBOURS))
    apart = np.abs(samples.pixels[others] - samples.pixels[first, None, None]).max(axis=-1)
    nearest = np.where(apart > 0, apart, np.iinfo(np.int64).max).argmin(axis=-1)
    near = np.take_along_axis(others, nearest[..., None], axis=-1)[..., 0]
    return samples.points[np.column_stack([first, near])].astype(np.float64)


def _planes_of(triples: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 4) planes through three points each; one through points on a line is nowhere."""
    normals = np.cross(triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.maximum(lengths, 1e-12)
    offsets = np.sum(normals * triples[:, 0], axis=1, keepdims=True)
    planes = np.where(lengths > 1e-9, np.concatenate([normals, offsets], axis=1), (0, 0, 0, -1e3))
    return facing_camera(planes)
