"""How the learning rate of every training goes."""

from math import cos, pi

WARM_UP = 0.05
"""Share of the steps in which the learning rate rises."""


def schedule(progress: float, warm_up: float = WARM_UP) -> float:
    """The learning rate as a share of the highest, at a progress from 0 to 1: it rises, then falls as a cosine."""
    if progress < warm_up:
        return progress / warm_up
    return (1 + cos(pi * (progress - warm_up) / (1 - warm_up))) / 2
