"""Where a victim lies with a stated probability, for drawings."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri


def ellipsoids(
    covariances: NDArray[np.float64], probability: float = 0.95
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The ellipsoids around places that hold them with a probability, given their (..., n, n) covariances, m².

    Returns:
        (..., n) half axes, m, the shortest first, and (..., n, n) their directions as columns.
    """
    variances, directions = np.linalg.eigh(covariances)
    return np.sqrt(chdtri(variances.shape[-1], 1 - probability) * variances), directions
