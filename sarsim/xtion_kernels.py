"""The pixel loops of the Xtion's noise model."""

from typing import NamedTuple

import numpy as np
from numba import njit, uint64
from numpy.typing import NDArray
from scipy.special import ndtri

NORMAL = ndtri((np.arange(1 << 16) + 0.5) / (1 << 16)).astype(np.float32)
"""(65536,) float32 quantiles of the normal distribution: a 16-bit random number picks one. The tails end at 4.3 σ."""


@njit(cache=True)
def random_bits(key: int, index: int) -> int:
    """64 random bits for a pixel: splitmix64 (Steele, Lea & Flood 2014) at a position of the stream of ``key``.

    What a pixel draws depends on its index alone, so the order in which pixels are visited does not matter.
    """
    z = uint64(key) + uint64(index + 1) * uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> uint64(30))) * uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> uint64(27))) * uint64(0x94D049BB133111EB)
    return z ^ (z >> uint64(31))


@njit(cache=True)
def projector_shadow(inverse_depth: NDArray[np.float32], focal_baseline: float) -> NDArray[np.bool_]:
    """(H, W) bool, the pixels that the projector's light does not reach.

    The projector stands right of the camera: it sees the point of column u at u - f b / z. The light of that column
    ends on what lies further right in the image if that is seen at the same column or one left of it.
    """
    height, width = inverse_depth.shape
    shadow = np.zeros((height, width), np.bool_)
    for v in range(height):
        leftmost = np.float32(np.inf)
        for u in range(width - 1, -1, -1):
            column = np.float32(u - focal_baseline * inverse_depth[v, u])
            if column < leftmost:
                leftmost = column
            else:
                shadow[v, u] = True
    return shadow


@njit(cache=True)
def slope(values: NDArray[np.float32], v: int, u: int) -> tuple[float, float]:
    """Change of ``values`` per column and per row at a pixel, on the smoother side of it.

    The smoother side is that of the surface itself where the other one lies beyond an edge. Inverse depth changes
    linearly over the picture of a plane, so there it is exact.
    """
    height, width = values.shape
    here = values[v, u]
    left = here - values[v, max(u - 1, 0)] if u > 0 else np.inf
    right = values[v, u + 1] - here if u < width - 1 else np.inf
    up = here - values[v - 1, u] if v > 0 else np.inf
    down = values[v + 1, u] - here if v < height - 1 else np.inf
    return (left if abs(left) < abs(right) else right), (up if abs(up) < abs(down) else down)


@njit(cache=True)
def lateral_source(
    inverse_depth: NDArray[np.float32], bits: int, v: int, u: int, sigma: float, edge: float
) -> tuple[int, int]:
    """The row and column that a pixel really looks at: a random neighbour, if that lies across a depth edge.

    On the pixel's own plane the displaced sample has the depth that the pixel has anyway, up to the axial noise.
    """
    height, width = inverse_depth.shape
    du = int(np.rint(sigma * NORMAL[(bits >> uint64(16)) & uint64(0xFFFF)]))
    dv = int(np.rint(sigma * NORMAL[(bits >> uint64(32)) & uint64(0xFFFF)]))
    if (du == 0 and dv == 0) or not (0 <= u + du < width and 0 <= v + dv < height):
        return v, u
    per_column, per_row = slope(inverse_depth, v, u)
    expected = inverse_depth[v, u] + per_column * du + per_row * dv
    if abs(inverse_depth[v + dv, u + du] - expected) < edge:
        return v, u
    return v + dv, u + du


class Noise(NamedTuple):
    """The numbers that :func:`measure` needs; what is switched off has the value that changes nothing."""

    fx: float
    fy: float
    cx: float
    cy: float
    focal_baseline: float  # pixels × metres: disparity over inverse depth
    nearest: float
    farthest: float
    axial: float  # factor on the axial σ: 0 or 1
    lateral: float  # σ in pixels; 0 = off
    edge: float  # 1/m
    step: float  # pixels of disparity; 0 = off
    grazing: float  # cosine of the incidence from which on nothing returns; 0 = off
    dropout: float


@njit(cache=True)
def cosine_of_incidence(inverse_depth: NDArray[np.float32], v: int, u: int, noise: Noise) -> float:
    """Cosine between the line of sight and the surface's normal.

    A plane a X + b Y + c Z = 1 has the inverse depth a x + b y + c at the picture point x = X / Z, y = Y / Z.
    """
    per_column, per_row = slope(inverse_depth, v, u)
    x, y = (u + 0.5 - noise.cx) / noise.fx, (v + 0.5 - noise.cy) / noise.fy
    a, b = per_column * noise.fx, per_row * noise.fy
    c = inverse_depth[v, u] - a * x - b * y
    return inverse_depth[v, u] / np.sqrt((a * a + b * b + c * c) * (x * x + y * y + 1))


@njit(cache=True)
def axial_sigma(z: float, cosine: float) -> float:
    """Standard deviation of depth in metres: Nguyen, Izadi & Lovell 2012, equation 3."""
    sigma = 0.0012 + 0.0019 * (z - 0.4) ** 2
    if cosine < 0.5:  # 60 degrees
        angle = np.arccos(cosine)
        sigma += 0.0001 / np.sqrt(z) * (angle / (0.5 * np.pi - angle)) ** 2
    return sigma


@njit(cache=True)
def measured_depth(
    inverse_depth: NDArray[np.float32], shadow: NDArray[np.bool_], bits: int, v: int, u: int, noise: Noise
) -> float:
    """What the sensor makes of one sample of the true depth, in metres; 0 = no return."""
    if inverse_depth[v, u] == 0 or shadow[v, u]:
        return 0.0
    if (bits >> uint64(48)) < noise.dropout * 65536:
        return 0.0
    cosine = cosine_of_incidence(inverse_depth, v, u, noise)
    if cosine <= noise.grazing:
        return 0.0
    z = 1.0 / inverse_depth[v, u]
    z += noise.axial * axial_sigma(z, cosine) * NORMAL[bits & uint64(0xFFFF)]
    if noise.step > 0 and z > 0:
        z = noise.focal_baseline / (noise.step * max(np.rint(noise.focal_baseline / (z * noise.step)), 1))
    return z if noise.nearest <= z <= noise.farthest else 0.0


@njit(cache=True)
def measure(
    inverse_depth: NDArray[np.float32], shadow: NDArray[np.bool_], key: int, noise: Noise
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """(H, W) float32 measured depth in metres, and (H, W) int32 flat index of the pixel that each was sampled at."""
    height, width = inverse_depth.shape
    depth = np.empty((height, width), np.float32)
    source = np.empty((height, width), np.int32)
    for v in range(height):
        for u in range(width):
            bits = random_bits(key, v * width + u)
            row, column = v, u
            if noise.lateral > 0:
                row, column = lateral_source(inverse_depth, bits, v, u, noise.lateral, noise.edge)
            depth[v, u] = measured_depth(inverse_depth, shadow, bits, row, column, noise)
            source[v, u] = row * width + column
    return depth, source
