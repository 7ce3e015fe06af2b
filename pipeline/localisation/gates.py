"""Statistical tests that the whole pipeline makes at one level of confidence."""

from functools import cache

from scipy.stats import chi2

CONFIDENCE = 0.99
"""Probability that a test accepts what is true."""


@cache
def chi2_gate(dimensions: int) -> float:
    """Greatest squared Mahalanobis distance at which a Gaussian of so many dimensions accepts a measurement."""
    return float(chi2.ppf(CONFIDENCE, dimensions))
