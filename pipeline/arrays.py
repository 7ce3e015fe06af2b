"""Names for the arrays that pass between functions: dtype, shape, unit and frame stand here once.

What a name leaves open, such as the frame of points that are not in ``map``, the docstring says.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Pose: TypeAlias = NDArray[np.float64]
"""4×4 float64 rigid transform ``T_a_b``, which takes coordinates in b to a; m."""
Poses: TypeAlias = NDArray[np.float64]
"""(K, 4, 4) float64 rigid transforms; m."""
Rotation3: TypeAlias = NDArray[np.float64]
"""3×3 float64 rotation matrix."""

Points: TypeAlias = NDArray[np.float32]
"""(N, 3) float32 points; m in ``map``, or in the frame that is named."""
Places: TypeAlias = NDArray[np.float64]
"""(N, 2) or (N, 3) float64 places; m in ``map``."""
Place: TypeAlias = NDArray[np.float64]
"""(2,) or (3,) float64 place; m in ``map``."""
Direction: TypeAlias = NDArray[np.float64]
"""(2,) or (3,) float64 vector of length 1."""
Directions: TypeAlias = NDArray[np.float64]
"""(N, 2) or (N, 3) float64 vectors of length 1."""
Planes: TypeAlias = NDArray[np.float64]
"""(P, 4) or (4,) float64 planes [n, d]: the points x, m, with n · x = d; n has length 1."""
Box: TypeAlias = NDArray[np.float64]
"""(2, 3) float64 lowest and highest corner; m."""
Boxes: TypeAlias = NDArray[np.float64]
"""(M, 2, 3) float64 lowest and highest corners; m."""

Covariance: TypeAlias = NDArray[np.float64]
"""(D, D) float64; of a pose (6, 6) in its tangent, rotation (rad) before translation (m), of a place in m²."""
Information: TypeAlias = NDArray[np.float64]
"""(D, D) float64 inverse of a covariance: of a pose's (6, 6), 1/rad² and 1/m², of a place's in 1/m²."""

Mask: TypeAlias = NDArray[np.bool_]
"""(N,) bool, one for each item."""
Indices: TypeAlias = NDArray[np.int64]
"""(N,) int64 numbers of items."""
Values: TypeAlias = NDArray[np.float64]
"""(N,) float64, one for each item; the unit is named."""
Labels: TypeAlias = NDArray[np.uint8]
"""(N,) uint8 :class:`pipeline.labels.Label`, one for each item."""
Probabilities: TypeAlias = NDArray[np.float32]
"""(N, 8) float32 probability of each label, one row for each item."""

Cells: TypeAlias = NDArray[np.int64]
"""(N, 2) or (N, 3) int64 indices of cells of a grid, or of voxels."""
Layer: TypeAlias = NDArray[np.floating]
"""(nx, ny) values of a grid's cells; the unit is named."""
MaskLayer: TypeAlias = NDArray[np.bool_]
"""(nx, ny) bool, one for each cell of a grid."""

Rgb: TypeAlias = NDArray[np.uint8]
"""(H, W, 3) uint8 image, red, green, blue."""
Depth: TypeAlias = NDArray[np.float32]
"""(H, W) float32 depth along the optical axis in m; 0 = no return."""
PixelMask: TypeAlias = NDArray[np.bool_]
"""(H, W) bool, one for each pixel."""
Pixels: TypeAlias = NDArray[np.float32]
"""(N, 2) float32 x and y in an image, pixels from its upper left corner."""
