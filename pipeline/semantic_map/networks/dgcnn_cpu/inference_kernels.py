"""The parts of fast inference that are not matrix products; they release Python's global interpreter lock."""

import numpy as np
from numba import njit

from pipeline.semantic_map.networks.dgcnn import MAX_NEIGHBOURS

GROUPS = 256
"""Number of groups, each of every 256th point; SIMD finds the closest points of several groups at once."""


@njit(cache=True, nogil=True, boundscheck=False)
def select_nearest(product, half_square, neighbours):
    """Find the k points j nearest to each point i, which have the largest closeness ``x_i · x_j − |x_j|² / 2``.

    Of equally close points, the point with the lower index is taken. A branch that the processor cannot predict costs
    as much as a row of comparisons, so the code has almost no branches.

    Args:
        product: (R, N) float32 ``x_i · x_j`` of R points with all N.
        half_square: (N,) float32 ``|x_j|² / 2``.
        neighbours: (R, k) int32, filled; k ≤ MAX_NEIGHBOURS and k ≤ N.
    """
    count, k = product.shape[1], neighbours.shape[1]
    best, best_of_best = np.empty(GROUPS, np.float32), np.empty(MAX_NEIGHBOURS, np.float32)
    rank, groups = np.empty(MAX_NEIGHBOURS, np.int32), np.empty(GROUPS + 1, np.int32)
    # Zeros, so that with NaN, which cannot be compared, the neighbours are wrong but still valid indices.
    candidates, closeness = np.zeros(count + 1, np.int32), np.empty(count + 1, np.float32)
    for r in range(len(product)):
        row = product[r]
        _best_of_groups(row, half_square, best)
        bound = _lower_bound(best, best_of_best, rank, k)
        found, worthwhile = 0, 0
        for g in range(GROUPS):
            groups[worthwhile] = g
            worthwhile += int(best[g] >= bound)
        for g in range(worthwhile):
            for j in range(groups[g], count, GROUPS):
                candidates[found], closeness[found] = j, row[j] - half_square[j]
                found += int(closeness[found] >= bound)
        _drop_worst(candidates, closeness, found, k)
        neighbours[r] = candidates[:k]


@njit(cache=True, nogil=True, boundscheck=False)
def _best_of_groups(row, half_square, best):
    """Fill ``best`` with the largest closeness of every group; group g holds points g, g + GROUPS, g + 2 GROUPS …"""
    whole = len(row) - len(row) % GROUPS
    best[:] = -np.inf
    for start in range(0, whole, GROUPS):
        for g in range(GROUPS):
            closeness = row[start + g] - half_square[start + g]
            best[g] = closeness if closeness > best[g] else best[g]
    for j in range(whole, len(row)):
        best[j - whole] = max(best[j - whole], row[j] - half_square[j])


@njit(cache=True, nogil=True, boundscheck=False)
def _lower_bound(best, best_of_best, rank, k):
    """A lower bound on the k nearest points' closeness: the k-th largest of MAX_NEIGHBOURS maxima."""
    best_of_best[:] = best[:MAX_NEIGHBOURS]
    for start in range(MAX_NEIGHBOURS, GROUPS, MAX_NEIGHBOURS):
        for b in range(MAX_NEIGHBOURS):
            value = best[start + b]
            best_of_best[b] = value if value > best_of_best[b] else best_of_best[b]
    rank[:] = 0
    for other in range(MAX_NEIGHBOURS):
        value = best_of_best[other]
        for b in range(MAX_NEIGHBOURS):
            rank[b] += int(value >= best_of_best[b])
    bound = np.float32(-np.inf)
    for b in range(MAX_NEIGHBOURS):
        value = best_of_best[b] if rank[b] >= k else np.float32(-np.inf)
        bound = value if value > bound else bound
    return bound


@njit(cache=True, nogil=True, boundscheck=False)
def _drop_worst(candidates, closeness, found, k):
    """Move the k closest candidates to the front."""
    for last in range(found - 1, k - 1, -1):
        worst, least = 0, closeness[0]
        for c in range(1, last + 1):
            worse = closeness[c] < least or (closeness[c] == least and candidates[c] > candidates[worst])
            worst = c if worse else worst
            least = closeness[c] if worse else least
        candidates[worst], closeness[worst] = candidates[last], closeness[last]


@njit(cache=True, nogil=True, boundscheck=False)
def difference_edges(points, first, neighbours, edges):
    """Compute [x_j − x_i, x_i] of every edge.

    Args:
        points: (N, C) float32.
        first, neighbours: index of the first of R successive points, and their (R, k) int32 neighbours.
        edges: (R k, 2 C) float32, filled.
    """
    count, k = neighbours.shape
    channels = points.shape[1]
    for i in range(count):
        mine = points[first + i]
        for n in range(k):
            theirs, edge = points[neighbours[i, n]], edges[i * k + n]
            for c in range(channels):
                edge[c] = theirs[c] - mine[c]
                edge[channels + c] = mine[c]


@njit(cache=True, nogil=True, boundscheck=False, fastmath={"contract"})
def normalize_edges(edges, scale, shift, slope):
    """LeakyReLU(scale x + shift) in place; edges (E, C) float32, scale and shift (C,) float32."""
    for e in range(len(edges)):
        edge = edges[e]
        for c in range(len(edge)):
            response = edge[c] * scale[c] + shift[c]
            edge[c] = max(response, slope * response)


@njit(cache=True, nogil=True, boundscheck=False)
def sum_edges(of_neighbour, of_point, neighbours, slope, edges):
    """Compute LeakyReLU(A x_j + B x_i) of every edge.

    Args:
        of_neighbour: (N, C) float32 A x_j of all points.
        of_point, neighbours: (R, C) float32 B x_i of R points and their (R, k) int32 neighbours.
        slope: slope of LeakyReLU below 0.
        edges: (R k, C) float32, filled.
    """
    count, k = neighbours.shape
    for i in range(count):
        mine = of_point[i]
        for n in range(k):
            theirs, edge = of_neighbour[neighbours[i, n]], edges[i * k + n]
            for c in range(len(mine)):
                response = theirs[c] + mine[c]
                edge[c] = max(response, slope * response)


@njit(cache=True, nogil=True, boundscheck=False, fastmath={"contract"})
def largest_edge(edges, scale, shift, slope, features):
    """Compute LeakyReLU(scale · max over the neighbours + shift); monotonic functions may follow the maximum.

    Args:
        edges: (R k, C) float32.
        scale, shift: (C,) float32, scale not negative.
        slope: slope of LeakyReLU below 0.
        features: (R, C) float32, filled.
    """
    k = len(edges) // len(features)
    for i in range(len(features)):
        feature = features[i]
        feature[:] = edges[i * k]
        for n in range(1, k):
            edge = edges[i * k + n]
            for c in range(len(feature)):
                feature[c] = edge[c] if edge[c] > feature[c] else feature[c]
        for c in range(len(feature)):
            response = feature[c] * scale[c] + shift[c]
            feature[c] = max(response, slope * response)


@njit(cache=True, nogil=True, boundscheck=False)
def largest_sum(of_neighbour, of_point, neighbours, slope, features):
    """Fill ``features`` (R, C) float32: LeakyReLU(max over neighbours of A x_j + B x_i).

    For the other arguments, see :func:`sum_edges`.
    """
    count, k = neighbours.shape
    for i in range(count):
        feature = features[i]
        feature[:] = of_neighbour[neighbours[i, 0]]
        for n in range(1, k):
            theirs = of_neighbour[neighbours[i, n]]
            for c in range(len(feature)):
                feature[c] = theirs[c] if theirs[c] > feature[c] else feature[c]
        for c in range(len(feature)):
            response = feature[c] + of_point[i, c]
            feature[c] = max(response, slope * response)
