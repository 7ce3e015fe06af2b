"""Depth images as uint16, half the memory, kept to build the maps again when poses are corrected."""

import numpy as np
from numpy.typing import NDArray

STEP = 1e-4  # m; a tenth of the resolution of the best depth camera
FARTHEST = 65535  # greater depths are stored as this one, which is beyond the range of the metric map


def pack_depth(depth: NDArray[np.float32]) -> NDArray[np.uint16]:
    """(H, W) uint16: depth (H, W), m, in units of ``STEP``; 0 where it is no return: not finite or not positive."""
    is_return = np.isfinite(depth) & (depth > 0)
    return np.rint(np.where(is_return, depth, 0).clip(max=FARTHEST * STEP) / STEP).astype(np.uint16)


def unpack_depth(packed: NDArray[np.uint16], out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
    """(H, W) float32, m, 0 = no return; written to ``out`` if it has that shape, which saves an allocation."""
    if out is None or out.shape != packed.shape:
        out = np.empty(packed.shape, np.float32)
    return np.multiply(packed, np.float32(STEP), out=out)


def unpack_returns(packed: NDArray[np.uint16]) -> NDArray[np.float32]:
    """(H, W) float32, m, 0 = no return; a surface at ``FARTHEST`` or beyond is none, for its place is not known."""
    return unpack_depth(np.where(packed < FARTHEST, packed, np.uint16(0)))
