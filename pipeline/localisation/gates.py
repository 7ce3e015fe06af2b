"""Thresholds of statistical tests."""

from functools import cache

from scipy.special import chdtri  # scipy.stats.chi2 takes half a second to import in every process


@cache
def chi2_gate(dimensions: int, confidence: float) -> float:
    """Squared Mahalanobis distance within which a Gaussian variable lies with the probability ``confidence``.

    ``dimensions``: number of dimensions of the variable.
    """
    return float(chdtri(dimensions, 1 - confidence))
