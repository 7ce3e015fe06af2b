"""Ids of victims and confidence ellipsoids, for the report, the drawings and the log."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from pipeline.tracks.track import Track
from pipeline.tracks.tracks import Tracks

PROBABILITY = 0.95
"""Probability with which a position lies in its ellipsoid."""


def confirmed_with_ids(victims: Tracks) -> list[tuple[str, Track]]:
    """The confirmed victims with their ids: "1", "2", …"""
    return [(str(k), victim) for k, victim in enumerate(victims.confirmed, start=1)]


def unconfirmed_with_ids(victims: Tracks) -> list[tuple[str, Track]]:
    """The unconfirmed victims that are worth another look, with their ids: "A", "B", …"""
    return [(letters(k), victim) for k, victim in enumerate(victims.worth_a_look)]


def letters(k: int) -> str:
    """The letters A, B, … Z, AA, AB, … for k = 0, 1, …"""
    head, last = divmod(k, 26)
    return (letters(head - 1) if head else "") + chr(ord("A") + last)


def ellipsoids(covariances: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The ellipsoids that contain positions with :data:`PROBABILITY`, from their (..., n, n) covariances, m².

    Returns:
        (..., n) semi-axes, m, the shortest first, and (..., n, n) their directions as columns.
    """
    variances, directions = np.linalg.eigh(covariances)
    return np.sqrt(chdtri(variances.shape[-1], 1 - PROBABILITY) * variances), directions
