"""The pixel loops of the Xtion's noise model."""

import numpy as np
from numba import njit, uint64
from scipy.special import ndtri

NORMAL_QUANTILES = ndtri((np.arange(1 << 16) + 0.5) / (1 << 16)).astype(np.float32)
"""(65536,) float32 quantiles of the normal distribution, indexed by 16 random bits; they end at 4.3 σ."""


@njit(cache=True)
def random_bits(key, height, width):
    """(H, W) uint64 random bits, the stream of splitmix64 with seed ``key`` (Steele, Lea & Flood, OOPSLA 2014).

    A pixel's bits depend on its position alone, not on the order in which the pixels are visited.
    """
    bits = np.empty((height, width), np.uint64)
    for v in range(height):
        for u in range(width):
            z = key + uint64(v * width + u + 1) * uint64(0x9E3779B97F4A7C15)
            z = (z ^ (z >> uint64(30))) * uint64(0xBF58476D1CE4E5B9)
            z = (z ^ (z >> uint64(27))) * uint64(0x94D049BB133111EB)
            bits[v, u] = z ^ (z >> uint64(31))
    return bits


@njit(cache=True)
def slopes(values):
    """Two (H, W) float32, the change of an image per column and per row, each on the smoother side of the pixel.

    Next to an edge, the smoother side belongs to the pixel's own surface. The disparity of a plane is linear over the
    image, so its slopes are exact.
    """
    height, width = values.shape
    per_column = np.empty_like(values)
    per_row = np.empty_like(values)
    for v in range(height):
        above, here, below = values[max(v - 1, 0)], values[v], values[min(v + 1, height - 1)]
        for u in range(1, width - 1):
            per_column[v, u] = smaller(here[u] - here[u - 1], here[u + 1] - here[u])
        per_column[v, 0] = here[1] - here[0]
        per_column[v, width - 1] = here[width - 1] - here[width - 2]
        for u in range(width):
            per_row[v, u] = smaller(here[u] - above[u], below[u] - here[u])
    per_row[0] = values[1] - values[0]
    per_row[height - 1] = values[height - 1] - values[height - 2]
    return per_column, per_row


@njit(cache=True)
def smaller(a, b):
    """The one of two numbers that has the smaller magnitude."""
    return a if abs(a) < abs(b) else b


@njit(cache=True)
def lateral_source(disparity, per_column, per_row, bits, sigma, edge):
    """(H, W) int64 flat index of the pixel whose depth each pixel measures.

    Disparity and its slopes are (H, W) float32, ``bits`` (H, W) uint64. The source is a random neighbour (standard
    deviation ``sigma`` pixels) if the neighbour lies across a depth edge, i.e. if its disparity differs from the
    pixel's own plane by at least ``edge`` pixels. Otherwise the source is the pixel itself.
    """
    height, width = disparity.shape
    source = np.empty((height, width), np.int64)
    for v in range(height):
        for u in range(width):
            source[v, u] = v * width + u
            du = int(np.rint(sigma * NORMAL_QUANTILES[(bits[v, u] >> uint64(16)) & uint64(0xFFFF)]))
            dv = int(np.rint(sigma * NORMAL_QUANTILES[(bits[v, u] >> uint64(32)) & uint64(0xFFFF)]))
            if 0 <= u + du < width and 0 <= v + dv < height:
                plane = disparity[v, u] + per_column[v, u] * du + per_row[v, u] * dv
                if abs(disparity[v + dv, u + du] - plane) >= edge:
                    source[v, u] += dv * width + du
    return source


@njit(cache=True)
def projector_shadow(disparity):
    """(H, W) bool, the pixels of (H, W) float32 disparity that the projector's light does not reach.

    The projector is to the camera's right and sees the point of image column u at its own column u - disparity. Its
    light ends on another surface if a pixel further right in the image has the same projector column or a lower one.
    """
    height, width = disparity.shape
    shadow = np.zeros((height, width), np.bool_)
    for v in range(height):
        leftmost = np.inf
        for u in range(width - 1, -1, -1):
            column = u - disparity[v, u]
            shadow[v, u] = column >= leftmost
            leftmost = min(leftmost, column)
    return shadow


@njit(cache=True, error_model="numpy")
def cosine_of_incidence(disparity, per_column, per_row, rays, fx, fy):
    """(H, W) float32 cosine between the line of sight and the surface's normal.

    At the image point x = X / Z, y = Y / Z, a plane a X + b Y + c Z = 1 has a disparity proportional to
    a x + b y + c. Disparity and its slopes per column and row are (H, W) float32, ``rays`` (H, W, 3).
    """
    height, width = disparity.shape
    cosine = np.empty((height, width), np.float32)
    columns = rays[0, :, 0].copy()  # contiguous in memory, so that the inner loop is vectorised
    for v in range(height):
        y = rays[v, 0, 1]
        here, across, down, result = disparity[v], per_column[v], per_row[v], cosine[v]
        for u in range(width):
            x = columns[u]
            a, b = across[u] * fx, down[u] * fy
            c = here[u] - a * x - b * y
            result[u] = here[u] / np.sqrt((a * a + b * b + c * c) * (x * x + y * y + 1))
    return cosine


@njit(cache=True, error_model="numpy")
def axial_sigma(depth, cosine):
    """(H, W) float32 m, standard deviation of (H, W) depth, m, by equation 3 of Nguyen, Izadi & Lovell 2012."""
    sigma = np.empty_like(depth)
    for v in range(depth.shape[0]):
        z, cos, result = depth[v], cosine[v], sigma[v]
        for u in range(len(z)):
            result[u] = 0.0012 + 0.0019 * (z[u] - 0.4) ** 2
        for u in range(len(z)):
            if cos[u] < 0.5 and z[u] > 0:  # past 60 degrees
                angle = np.arccos(cos[u])
                result[u] += 0.0001 / np.sqrt(z[u]) * (angle / (np.pi / 2 - angle)) ** 2
    return sigma


@njit(cache=True)
def add_noise(depth, sigma, bits):
    """Add normal noise with standard deviation ``sigma`` (H, W) m to the returns in ``depth`` (H, W) m, in place."""
    for v in range(depth.shape[0]):
        z, spread, row = depth[v], sigma[v], bits[v]
        for u in range(len(z)):
            if z[u] > 0:
                z[u] += spread[u] * NORMAL_QUANTILES[row[u] & uint64(0xFFFF)]


@njit(cache=True, error_model="numpy")
def quantise(depth, focal_baseline, step):
    """Round (H, W) float32 depth, m, to whole steps of disparity, in place; no return stays 0.

    ``focal_baseline``: product of focal length, px, and baseline, m; ``step``: step of disparity, px.
    """
    for v in range(depth.shape[0]):
        row = depth[v]
        for u in range(len(row)):
            steps = np.rint(focal_baseline / row[u] / step)
            row[u] = focal_baseline / (steps * step) if row[u] > 0 else np.float32(0)
