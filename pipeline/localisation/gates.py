"""Statistical tests."""

from functools import cache

from scipy.special import chdtri  # of chi2 in scipy.stats, whose import takes half a second of every process

CONFIDENCE = 0.99
"""Probability that a test accepts what is true."""


@cache
def chi2_gate(dimensions: int, confidence: float = CONFIDENCE) -> float:
    """Greatest squared Mahalanobis distance at which a Gaussian of so many dimensions accepts a measurement."""
    return float(chdtri(dimensions, 1 - confidence))
