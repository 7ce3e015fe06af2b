"""Reading OctoMap's trees. Both kinds list their nodes depth first, children in the order of their codes."""

import numpy as np
from numba import njit

FREE_CHILD, OCCUPIED_CHILD, INNER_CHILD = 1, 2, 3
"""What two bits say of a child in a ``.bt`` file: 10, 01 and 11, the lower bit first; 00 is unknown."""


@njit(cache=True)
def decode_bt(data, depth, leaves):
    """Read the inner nodes of a binary tree, two bytes each.

    Args:
        data: (N,) uint8.
        depth: levels below the root.
        leaves: (M, 3) int64 to fill: code, level (0 = a single voxel) and FREE_CHILD or OCCUPIED_CHILD.

    Returns:
        The number of leaves; -1 if the data end early, go on, or go deeper than the tree.
    """
    stack = np.zeros((8 * depth + 1, 2), np.int64)
    stack[0, 1] = depth
    top, position, count = 1, 0, 0
    while top > 0:
        top -= 1
        code, level = stack[top, 0], stack[top, 1]
        if level == 0 or position + 2 > data.size:
            return -1
        bits = np.int64(data[position]) | (np.int64(data[position + 1]) << 8)
        position += 2
        for child in range(7, -1, -1):
            kind = (bits >> (2 * child)) & 3
            if kind == INNER_CHILD:
                stack[top, 0], stack[top, 1] = code * 8 + child, level - 1
                top += 1
            elif kind != 0:
                leaves[count, 0], leaves[count, 1], leaves[count, 2] = code * 8 + child, level - 1, kind
                count += 1
    return count if position == data.size else -1


@njit(cache=True)
def decode_ot(data, depth, stride, leaves):
    """Read the nodes of a full tree; the last of a node's bytes has a bit for each child.

    Args:
        data: (N,) uint8.
        depth: levels below the root.
        stride: bytes of a node.
        leaves: (M, 3) int64 to fill: code, level (0 = a single voxel) and number of the node.

    Returns:
        The number of leaves; -1 if the data end early, go on, or go deeper than the tree.
    """
    stack = np.zeros((8 * depth + 1, 2), np.int64)
    stack[0, 1] = depth
    top, node, count = 1, 0, 0
    while top > 0:
        top -= 1
        code, level = stack[top, 0], stack[top, 1]
        if (node + 1) * stride > data.size:
            return -1
        children = data[(node + 1) * stride - 1]
        if children == 0:
            leaves[count, 0], leaves[count, 1], leaves[count, 2] = code, level, node
            count += 1
        elif level == 0:
            return -1
        node += 1
        for child in range(7, -1, -1):
            if (children >> child) & 1:
                stack[top, 0], stack[top, 1] = code * 8 + child, level - 1
                top += 1
    return count if node * stride == data.size else -1
