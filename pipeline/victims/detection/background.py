"""The planes in the background of a person: what the person lies on, leans against or is seen in front of."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Planes
from pipeline.frame import Frame
from pipeline.geometry.planes import Moments, distances, facing_camera, planes_through
from pipeline.sensor import SensorModel

MOST_SAMPLES = 3000  # Approximate number of pixels sampled from the box and its margin
TRIALS = 200  # RANSAC's random draws for each plane
MIN_SHARE = 0.02  # Least share of the samples on a plane
BEYOND = 0.25  # Least ratio of a plane's samples outside the box to those inside for it to be background
PLANE_TOLERANCE = 0.012  # m from a plane, in addition to twice the sensor's noise, within which a point belongs to it
FLAT, FLAT_AREA, SURFACE_NOISE = 0.6, 0.04, 0.002
"""A plane is flatter than any person if the share FLAT of its samples is nearer to it than the sensor's noise plus
SURFACE_NOISE, m, and they cover at least FLAT_AREA, m² across the line of sight."""
CANDIDATES = 12
"""Random samples of which the nearest in the image to a first sample is taken: planes are small, and far apart."""


@dataclass(frozen=True, eq=False)
class _Samples:
    """Some pixels with depth.

    Attributes:
        points: (N, 3) float32 in ``camera_optical``, m.
        pixels: (N, 2) row and column.
        inside: (N,) bool, whether each lies in the box.
        solid_angle: solid angle that each sample represents, sr.
        sensor: that measured them.
    """

    points: NDArray[np.float32]
    pixels: NDArray[np.int64]
    inside: NDArray[np.bool_]
    solid_angle: float
    sensor: SensorModel

    def __getitem__(self, chosen: NDArray) -> "_Samples":
        return replace(self, points=self.points[chosen], pixels=self.pixels[chosen], inside=self.inside[chosen])


def background_planes(frame: Frame, box: tuple[float, float, float, float], rng: np.random.Generator) -> list[Planes]:
    """Planes in a box and around it, in ``camera_optical``.

    A plane that RANSAC finds is background if enough of it lies outside the box, or if it is too flat for a person.
    """
    samples, planes = _samples(frame, box), []
    enough = max(3, MIN_SHARE * len(samples.points))
    while len(samples.points) >= enough:
        plane = _plane(samples, rng)
        near = near_plane(samples.points, plane, samples.sensor)
        if np.count_nonzero(near) < enough:
            break
        outside = np.count_nonzero(near & ~samples.inside)
        if outside >= BEYOND * np.count_nonzero(near & samples.inside) or _is_flat(samples[near], plane):
            planes.append(plane)
        samples = samples[~near]
    return planes


def _is_flat(samples: _Samples, plane: Planes) -> bool:
    """Whether samples of a plane lie nearer to it than the samples of a round body would."""
    points = samples.points
    near = np.abs(distances(points, plane)) < SURFACE_NOISE + samples.sensor.sigma(points[:, 2])
    area = np.sum(np.square(points[:, 2])) * samples.solid_angle
    return bool(near.mean() >= FLAT and area >= FLAT_AREA)


def near_plane(points: NDArray[np.float32], plane: Planes, sensor: SensorModel) -> NDArray[np.bool_]:
    """(N,) bool: which points (N, 3) in ``camera_optical`` belong to a plane (4,)."""
    return np.abs(distances(points, plane)) < PLANE_TOLERANCE + 2 * sensor.sigma(points[:, 2])


def _samples(frame: Frame, box: tuple[float, float, float, float]) -> _Samples:
    """Pixels with depth of a grid over the box and a margin as wide as its longer side."""
    low, high = np.array(box[:2]), np.array(box[2:])
    margin = (high - low).max()
    size = (frame.intrinsics.width, frame.intrinsics.height)
    first = np.clip(low - margin, 0, size).astype(int)
    last = np.clip(high + margin, 0, size).astype(int)
    stride = max(1, int(np.sqrt(np.prod(last - first) / MOST_SAMPLES)))
    v, u = (axis.ravel() for axis in np.mgrid[first[1] : last[1] : stride, first[0] : last[0] : stride])
    seen = frame.returns[v, u]
    v, u = v[seen], u[seen]
    middle = np.stack([u, v], axis=1) + 0.5
    inside = np.all((middle >= low) & (middle <= high), axis=1)
    k = frame.intrinsics
    points = k.rays[v, u] * frame.depth[v, u, None]
    return _Samples(points, np.stack([v, u], axis=1), inside, stride**2 / (k.fx * k.fy), frame.sensor)


def _plane(samples: _Samples, rng: np.random.Generator) -> Planes:
    """The plane with most samples by RANSAC, fitted to these samples."""
    planes = facing_camera(planes_through(_triples(samples, TRIALS, rng)))
    points = samples.points
    near = (
        np.abs(distances(points, planes.astype(np.float32)))
        < (PLANE_TOLERANCE + 2 * samples.sensor.sigma(points[:, 2]))[:, None]
    )
    best = planes[near.sum(axis=0).argmax()]
    members = samples.points[near_plane(samples.points, best, samples.sensor)]
    if len(members) < 3:
        return best
    plane, _ = Moments.of(members).fit(best[:3])
    return np.append(plane.normal, plane.offset)


def _triples(samples: _Samples, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """(count, 3, 3) triples of a random point and two points near it in the image."""
    first = rng.integers(len(samples.points), size=count)
    others = rng.integers(len(samples.points), size=(count, 2, CANDIDATES))
    apart = np.abs(samples.pixels[others] - samples.pixels[first, None, None]).max(axis=-1)
    nearest = np.where(apart > 0, apart, np.iinfo(np.int64).max).argmin(axis=-1)
    near = np.take_along_axis(others, nearest[..., None], axis=-1)[..., 0]
    return samples.points[np.column_stack([first, near])].astype(np.float64)
