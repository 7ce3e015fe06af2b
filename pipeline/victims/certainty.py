"""Confidence ellipsoids of victims' positions, for drawings."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri


def ellipsoids(
    covariances: NDArray[np.float64], probability: float = 0.95
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The ellipsoids that contain positions with a given probability, from their (..., n, n) covariances, m².

    Returns:
        (..., n) semi-axes, m, the shortest first, and (..., n, n) their directions as columns.
    """
    variances, directions = np.linalg.eigh(covariances)
    return np.sqrt(chdtri(variances.shape[-1], 1 - probability) * variances), directions
