"""Where a victim lies with a stated probability, for drawings."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

PROBABILITY = 0.95


def ellipsoids(covariances: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The ellipsoids around (..., n) places that hold them with PROBABILITY, given their (..., n, n) covariances, m².

    Returns:
        (..., n) half axes, m, the shortest first, and (..., n, n) their directions as columns.
    """
    variances, directions = np.linalg.eigh(covariances)
    return np.sqrt(chdtri(variances.shape[-1], 1 - PROBABILITY) * variances), directions
