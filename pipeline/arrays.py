"""Names of array types, which define dtype, shape, unit and frame in one place.

Docstrings add details that a name leaves open, such as the frame of points that are not in ``map``.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Pose: TypeAlias = NDArray[np.float64]
"""4×4 float64 rigid transform ``T_a_b``, which transforms coordinates, m, from frame b to frame a."""
Poses: TypeAlias = NDArray[np.float64]
"""(K, 4, 4) float64 rigid transforms; m."""
Rotation3: TypeAlias = NDArray[np.float64]
"""3×3 float64 rotation matrix."""

Points: TypeAlias = NDArray[np.float32]
"""(N, 3) float32 points; m, in ``map`` unless another frame is named."""
Places: TypeAlias = NDArray[np.float64]
"""(N, 2) or (N, 3) float64 positions; m in ``map``."""
Place: TypeAlias = NDArray[np.float64]
"""(2,) or (3,) float64 position; m in ``map``."""
Direction: TypeAlias = NDArray[np.float64]
"""(2,) or (3,) float64 unit vector."""
Directions: TypeAlias = NDArray[np.float64]
"""(N, 2) or (N, 3) float64 unit vectors."""
Planes: TypeAlias = NDArray[np.float64]
"""(P, 4) or (4,) float64 planes [n, d]. A plane consists of the points x, m, with n · x = d; n is a unit vector."""
Box: TypeAlias = NDArray[np.float64]
"""(2, 3) float64 lowest and highest corner of an axis-aligned box; m."""
Boxes: TypeAlias = NDArray[np.float64]
"""(M, 2, 3) float64 lowest and highest corners of axis-aligned boxes; m."""

Covariance: TypeAlias = NDArray[np.float64]
"""(D, D) float64 covariance of a position (m²) or of a pose. The covariance of a pose is (6, 6), in the tangent space
of the pose, with rotation (rad) before translation (m)."""
Information: TypeAlias = NDArray[np.float64]
"""(D, D) float64 inverse of a :data:`Covariance`, in 1/rad² and 1/m²."""

Mask: TypeAlias = NDArray[np.bool_]
"""(N,) bool, one value per item."""
Indices: TypeAlias = NDArray[np.int64]
"""(N,) int64 indices of items."""
Values: TypeAlias = NDArray[np.float64]
"""(N,) float64, one value per item; docstrings name the unit."""
Labels: TypeAlias = NDArray[np.uint8]
"""(N,) uint8 :class:`pipeline.labels.Label`, one per item."""
Probabilities: TypeAlias = NDArray[np.float32]
"""(N, 8) float32 probability of each label, one row per item."""

Cells: TypeAlias = NDArray[np.int64]
"""(N, 2) or (N, 3) int64 indices of grid cells or voxels."""
Layer: TypeAlias = NDArray[np.floating]
"""(nx, ny) values of a grid's cells; docstrings name the unit."""
MaskLayer: TypeAlias = NDArray[np.bool_]
"""(nx, ny) bool, one value per grid cell."""

Rgb: TypeAlias = NDArray[np.uint8]
"""(H, W, 3) uint8 image, whose channels are red, green and blue."""
Depth: TypeAlias = NDArray[np.float32]
"""(H, W) float32 depth along the optical axis in m; 0 = no return."""
PixelMask: TypeAlias = NDArray[np.bool_]
"""(H, W) bool, one value per pixel."""
Pixels: TypeAlias = NDArray[np.float32]
"""(N, 2) float32 x and y of points in an image, in pixels from its upper-left corner."""
