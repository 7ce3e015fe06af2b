"""Statistical tests."""

from functools import cache

from scipy.special import chdtri  # of chi2 in scipy.stats, whose import takes half a second of every process


@cache
def chi2_gate(dimensions: int, confidence: float) -> float:
    """Greatest squared Mahalanobis distance of a share ``confidence`` of a Gaussian of so many dimensions."""
    return float(chdtri(dimensions, 1 - confidence))
