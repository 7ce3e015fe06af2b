"""Statistical tests."""

from functools import cache

from scipy.special import chdtri  # scipy.stats.chi2 takes half a second to import in every process


@cache
def chi2_gate(dimensions: int, confidence: float) -> float:
    """Squared Mahalanobis distance that a Gaussian of these ``dimensions`` stays within with ``confidence``."""
    return float(chdtri(dimensions, 1 - confidence))
