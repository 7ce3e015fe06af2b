"""The parts of training that are not matrix products. Edges are not stored: each pass computes them again."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, boundscheck=False)
def edge_moments(of_neighbour, of_point, neighbours, total, total_square, of_neighbours, of_origins, degree):
    """Add up sums over all edges; the response of an edge is A x_j + B x_i.

    Args:
        of_neighbour, of_point: (N, C) float32 A x_j and B x_i.
        neighbours: (N, k) int32.
        total, total_square: (C,) float64, added to: the responses and their squares.
        of_neighbours: (N, C) float32, added to: A x_j over the neighbours j of i.
        of_origins: (N, C) float32, added to: B x_i over the i whose neighbour is j.
        degree: (N,) float32, added to: the number of these i.
    """
    count, k = neighbours.shape
    channels = of_point.shape[1]
    square = np.empty(channels, np.float32)
    for i in range(count):
        mine, near = of_point[i], of_neighbours[i]
        square[:] = 0
        for n in range(k):
            j = neighbours[i, n]
            theirs, from_ = of_neighbour[j], of_origins[j]
            degree[j] += 1
            for c in range(channels):
                near[c] += theirs[c]
                from_[c] += mine[c]
                square[c] += (theirs[c] + mine[c]) ** 2
        for c in range(channels):
            total[c] += near[c] + k * mine[c]
            total_square[c] += square[c]


@njit(cache=True, nogil=True, boundscheck=False)
def largest_of_groups(edges, features, winners, total, total_square):
    """The maximum of every group of k successive rows, and its place in the group; also sums over all rows.

    Args:
        edges: (R k, C) float32.
        features: (R, C) float32, filled with the maxima.
        winners: (R, C) int32, filled with the maximum's place in its group.
        total, total_square: (C,) float64, added to: the rows and their squares.
    """
    k, channels = len(edges) // len(features), edges.shape[1]
    sum_, square = np.empty(channels, np.float32), np.empty(channels, np.float32)
    for i in range(len(features)):
        feature, winner = features[i], winners[i]
        feature[:], winner[:], sum_[:], square[:] = -np.inf, 0, 0, 0
        for n in range(k):
            edge = edges[i * k + n]
            for c in range(channels):
                larger = edge[c] > feature[c]
                feature[c] = edge[c] if larger else feature[c]
                winner[c] = n if larger else winner[c]
                sum_[c] += edge[c]
                square[c] += edge[c] * edge[c]
        for c in range(channels):
            total[c] += sum_[c]
            total_square[c] += square[c]


@njit(cache=True, nogil=True, boundscheck=False)
def largest_sums(of_neighbour, of_point, neighbours, features, winners):
    """Fill the (N, C) float32 maxima over the neighbours of A x_j + B x_i, and (N, C) int32 which neighbours win."""
    count, k = neighbours.shape
    for i in range(count):
        mine, feature, winner = of_point[i], features[i], winners[i]
        feature[:], winner[:] = -np.inf, 0
        for n in range(k):
            theirs = of_neighbour[neighbours[i, n]]
            for c in range(len(mine)):
                larger = theirs[c] > feature[c]
                feature[c] = theirs[c] if larger else feature[c]
                winner[c] = n if larger else winner[c]
        for c in range(len(mine)):
            feature[c] += mine[c]


@njit(cache=True, nogil=True, boundscheck=False)
def add_to_winners(gradient, winners, neighbours, to_neighbour):
    """Add the gradient (N, C) of a maximum over neighbours to the winners' rows of ``to_neighbour`` (N, C)."""
    for i in range(len(gradient)):
        for c in range(gradient.shape[1]):
            to_neighbour[neighbours[i, winners[i, c]], c] += gradient[i, c]


@njit(cache=True, nogil=True, boundscheck=False)
def backward_through_winners(gradient, winners, weight, edges, to_edges, to_weight):
    """Backward pass of the maximum over W h, through the few edges that are maxima.

    Args:
        gradient, winners: (R, C') float32 and int32, of the maximum.
        weight: (C', C) float32 W.
        edges: (R k, C) float32 h.
        to_edges, to_weight: of the shapes of edges and weight, to which their gradients are added.
    """
    k = len(edges) // len(gradient)
    for i in range(len(gradient)):
        for o in range(gradient.shape[1]):
            slope, e = gradient[i, o], i * k + winners[i, o]
            edge, to_edge, row, to_row = edges[e], to_edges[e], weight[o], to_weight[o]
            for c in range(edges.shape[1]):
                to_edge[c] += slope * row[c]
                to_row[c] += slope * edge[c]


@njit(cache=True, nogil=True, boundscheck=False)
def backward_through_edges(
    of_neighbour, of_point, first, neighbours, edges, to_edges, slope, to_neighbour, to_point, total, total_response
):  # fmt: skip
    """Backward pass from the activated edges to the points that they join.

    Args:
        of_neighbour, of_point: (N, C) float32 A x_j and B x_i of all points.
        first: index of the first of R successive points.
        neighbours: (N, k) int32.
        edges, to_edges: (R k, C) float32, these points' edges after LeakyReLU and their gradient.
        slope: of LeakyReLU below 0.
        to_neighbour, to_point: (N, C) float32, added to: the gradient before LeakyReLU.
        total, total_response: (C,) float64, added to: that gradient, and its product with A x_j + B x_i.
    """
    k, channels = neighbours.shape[1], edges.shape[1]
    product = np.empty(channels, np.float32)
    for r in range(len(edges) // k):
        i = first + r
        mine, to_mine = of_point[i], to_point[i]
        product[:] = 0
        for n in range(k):
            j, e = neighbours[i, n], r * k + n
            theirs, to_theirs, edge, to_edge = of_neighbour[j], to_neighbour[j], edges[e], to_edges[e]
            for c in range(channels):
                step = to_edge[c] if edge[c] > 0 else slope * to_edge[c]
                to_theirs[c] += step
                to_mine[c] += step
                product[c] += step * (theirs[c] + mine[c])
        for c in range(channels):
            total[c] += to_mine[c]
            total_response[c] += product[c]
