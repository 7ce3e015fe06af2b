"""The planes in the background of a person, on which the person lies or against which the person leans or is seen."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Indices, Mask, Planes, Points
from pipeline.frame import Frame
from pipeline.geometry.planes import Moments, distances, ransac_plane
from pipeline.sensor import SensorModel

SAMPLES = 3000
"""Approximate number of pixels sampled from the box and its margin."""
TRIALS = 200
"""Number of point triples that RANSAC draws for each plane."""
CANDIDATES = 12
"""Number of random samples among which each further point of a triple is chosen.

The sample nearest to the first point in the image is chosen, because planes are small and far apart.
"""
MIN_PLANE_FRACTION = 0.02
"""Minimum fraction of all samples that must lie on a plane."""
MIN_OUTSIDE_RATIO = 0.25
"""Minimum ratio of a plane's samples outside the box to its samples inside for the plane to be background."""
TOLERANCE = 0.012
"""Maximum distance of a point from its plane, in addition to the sensor's noise, m."""
SIGMAS = 2.0
"""Number of standard deviations of the sensor's noise that are added to ``TOLERANCE``."""
MIN_FLAT_FRACTION = 0.6
"""Minimum fraction of a plane's samples within ``FLAT_TOLERANCE`` for it to be flatter than any person."""
FLAT_TOLERANCE = 0.002
"""Maximum distance of these samples from the plane, in addition to one standard deviation of the noise, m."""
MIN_FLAT_AREA = 0.04
"""Minimum area of the plane's samples across the line of sight, m²."""


@dataclass(frozen=True, eq=False)
class _Samples:
    """Sampled pixels with depth.

    Attributes:
        points: points of the samples, in ``camera_optical``.
        pixels: (N, 2) row and column.
        inside: whether each sample lies in the box.
        solid_angle: solid angle that each sample represents, sr.
        sensor: model of the camera.
    """

    points: Points
    pixels: NDArray[np.int64]
    inside: Mask
    solid_angle: float
    sensor: SensorModel

    def __getitem__(self, chosen: Mask) -> "_Samples":
        return replace(self, points=self.points[chosen], pixels=self.pixels[chosen], inside=self.inside[chosen])


def background_planes(
    frame: Frame, box: tuple[float, float, float, float], rng: np.random.Generator
) -> tuple[Planes, Mask]:
    """The planes of the background in and around a box in pixels, and which of them are too flat for a person.

    A plane that RANSAC finds is background if enough of it lies outside the box, or if it is too flat for a person.

    Returns:
        (P, 4) planes in ``camera_optical``, and (P,) bool.
    """
    samples, planes, are_flat = _samples(frame, box), list[Planes](), list[bool]()
    enough = max(3, MIN_PLANE_FRACTION * len(samples.points))
    while len(samples.points) >= enough:
        plane = _largest_plane(samples, rng)
        near = is_near_plane(samples.points, plane, samples.sensor)
        if np.count_nonzero(near) < enough:
            break
        outside = np.count_nonzero(near & ~samples.inside)
        is_beyond = outside >= MIN_OUTSIDE_RATIO * np.count_nonzero(near & samples.inside)
        is_flat = _is_flat(samples[near], plane)
        if is_beyond or is_flat:
            planes.append(plane)
            are_flat.append(is_flat)
        samples = samples[~near]
    return np.reshape(planes, (-1, 4)), np.array(are_flat, np.bool_)


def _is_flat(samples: _Samples, plane: Planes) -> bool:
    """Whether the samples of a plane are too flat, over too large an area, to belong to a round body."""
    points = samples.points
    near = np.abs(distances(points, plane)) < FLAT_TOLERANCE + samples.sensor.sigma(points[:, 2])
    area = np.sum(np.square(points[:, 2])) * samples.solid_angle
    return bool(near.mean() >= MIN_FLAT_FRACTION and area >= MIN_FLAT_AREA)


def is_near_plane(points: Points, plane: Planes, sensor: SensorModel) -> Mask:
    """Which points in ``camera_optical`` belong to a plane (4,)."""
    return np.abs(distances(points, plane)) < _tolerance(points, sensor)


def _tolerance(points: Points, sensor: SensorModel) -> NDArray[np.floating]:
    return TOLERANCE + SIGMAS * sensor.sigma(points[:, 2])


def _samples(frame: Frame, box: tuple[float, float, float, float]) -> _Samples:
    """The pixels with depth on a grid of about ``SAMPLES`` pixels.

    The grid covers the box and a margin as wide as the box's longer side.
    """
    low, high = np.array(box[:2]), np.array(box[2:])
    margin = (high - low).max()
    size = (frame.intrinsics.width, frame.intrinsics.height)
    first = np.clip(low - margin, 0, size).astype(int)
    last = np.clip(high + margin, 0, size).astype(int)
    stride = max(1, int(np.sqrt(np.prod(last - first) / SAMPLES)))
    v, u = (axis.ravel() for axis in np.mgrid[first[1] : last[1] : stride, first[0] : last[0] : stride])
    seen = frame.returns[v, u]
    v, u = v[seen], u[seen]
    middle = np.stack([u, v], axis=1) + 0.5
    inside = np.all((middle >= low) & (middle <= high), axis=1)
    k = frame.intrinsics
    points = k.rays[v, u] * frame.depth[v, u, None]
    return _Samples(points, np.stack([v, u], axis=1), inside, stride**2 / (k.fx * k.fy), frame.sensor)


def _largest_plane(samples: _Samples, rng: np.random.Generator) -> Planes:
    """The plane with the most samples according to RANSAC, refitted to these samples."""
    points, sensor = samples.points, samples.sensor
    found = ransac_plane(points, _triples(samples, rng), _tolerance(points, sensor))
    if found is None:
        return np.full(4, np.nan)  # all samples lie on one line
    best, _ = found
    members = points[is_near_plane(points, best, sensor)]
    if len(members) < 3:
        return best
    plane, _ = Moments.of(members).fit(best[:3])
    return np.append(plane.normal, plane.offset)


def _triples(samples: _Samples, rng: np.random.Generator) -> Indices:
    """(trials, 3) indices of a random sample and of two samples near it in the image."""
    first = rng.integers(len(samples.points), size=TRIALS)
    others = rng.integers(len(samples.points), size=(TRIALS, 2, CANDIDATES))
    apart = np.abs(samples.pixels[others] - samples.pixels[first, None, None]).max(axis=-1)
    nearest = np.where(apart > 0, apart, np.iinfo(np.int64).max).argmin(axis=-1)
    near = np.take_along_axis(others, nearest[..., None], axis=-1)[..., 0]
    return np.column_stack([first, near])
