"""The pixel loop of dust in a depth image."""

import numpy as np
from numba import njit, uint64


@njit(cache=True)
def apply_to_depth(depth, distance, distance_per_depth, bits, extinction, speck_rate, min_range, max_range):
    """Remove some returns, and replace others with nearer returns from specks of dust.

    Args:
        depth: (H, W) m, measured depth; 0 = no return.
        distance: (H, W) m, true distance along the ray; 0 where there is no surface.
        distance_per_depth: (H, W) ratio of the distance along the ray to the depth.
        bits: (H, W) random bits: 16 for the loss, 16 for whether there is a speck, 32 for its distance.
        extinction: fraction of light lost per metre in thin layers, 1/m.
        speck_rate: probability that an infinite ray returns from a speck.
        min_range, max_range: minimum and maximum depth of a return, m; other specks give no return.

    Returns:
        (H, W) float32 m, depth, and (H, W) bool, the pixels whose depth is that of a speck.
    """
    thinned = depth.copy()
    specks = np.zeros(depth.shape, np.bool_)
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            reach = distance[v, u] if distance[v, u] > 0 else np.inf
            passing = np.exp(-2 * extinction * reach)  # to the surface and back
            loss = (bits[v, u] & uint64(0xFFFF)) / 65536
            chance = ((bits[v, u] >> uint64(16)) & uint64(0xFFFF)) / 65536
            if chance < speck_rate * (1 - passing):
                place = (bits[v, u] >> uint64(32)) / 4294967296
                nearer = -np.log(1 - place * (1 - passing)) / (2 * extinction) / distance_per_depth[v, u]
                specks[v, u] = min_range <= nearer <= max_range
                thinned[v, u] = nearer if specks[v, u] else 0
            elif loss >= passing:
                thinned[v, u] = 0
    return thinned, specks
