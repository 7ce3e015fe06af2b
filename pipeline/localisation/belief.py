"""The robot's belief about its motion and its position: a hidden Markov filter over five states.

The states change at configured rates. Three observations distinguish them: how well a frame registers under the
motion that each state implies, how far the frame agrees with the map, and whether the robot leans too far where the
map is level. Each is a vector of log-likelihoods, so the order of independent observations does not matter.
"""

from enum import IntEnum, auto

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from pipeline.arrays import Indices, Values
from pipeline.localisation.config import BeliefConfig

RECOVERY_WAY = 1.0
"""Mean length of a slip, or of being held, as the wheels measure it, m."""
TILES = 32
"""Number of tiles in a row of an image, whose depths are compared with the map: for the Xtion, 1.8° each."""
CORRELATED_TILES = 9
"""Number of tiles that count as one observation, since each is compared in a 3 × 3 window."""
IMAGE_SHARE = 0.75
"""Number of tiles in an image divided by the square of ``TILES``, for an aspect ratio of 4:3."""
PARTS = TILES**2 * IMAGE_SHARE / CORRELATED_TILES
"""Number of independent observations in an image."""
SHOWN_HERE, MISSING_HERE = 0.94, 0.05
"""Probabilities that a tile for which the map predicts a surface shows it, or has no return, if the robot is where it
believes it is. In 169 frames of unchanging arenas, 0.99 and 0.01 were measured, and 0.0002 of the tiles contradicted
the map. Tiles without a return come in patches, where surfaces are dark or seen at a grazing angle, so they count for
less."""
SHOWN_ELSEWHERE, CONTRADICTED_ELSEWHERE, MISSING_ELSEWHERE = 0.6, 0.2, 0.2
"""Probabilities that such a tile agrees, contradicts the map or has no return in a frame taken elsewhere, as measured
in 281 such frames."""


class MotionState(IntEnum):
    """How the robot moves."""

    NOMINAL = 0
    """It moves as its odometry says."""
    SLIPPING = auto()
    """It moves, but no farther than its wheels measure."""
    HELD = auto()
    """It does not move, whatever its wheels measure."""
    CARRIED = auto()
    """It was picked up and set down elsewhere."""
    BLIND = auto()
    """Its camera shows nothing, and it has moved too far on odometry alone to trust its pose."""


class Belief:
    """Probabilities of the five states.

    Attributes:
        probabilities: (5,) probability of each :class:`MotionState`.
        config: how often the motion goes wrong, and how much a frame says about the state.
    """

    def __init__(self, config: BeliefConfig = BeliefConfig()) -> None:
        self.config = config
        self.restart()

    def restart(self) -> None:
        """Become certain that the pose is right and the motion nominal."""
        self.probabilities = np.eye(len(MotionState))[MotionState.NOMINAL]

    def predict(self, distance: float, seconds: float) -> None:
        """Predict the state after the wheels have measured ``distance`` m in ``seconds`` s."""
        self.probabilities = self.probabilities @ transition(distance, seconds, self.config)

    def observe(self, log_likelihoods: Values) -> None:
        """Update the belief with the (5,) log-likelihoods of an observation, known up to a common constant."""
        with np.errstate(divide="ignore"):  # a state may be impossible
            logarithms = np.log(self.probabilities) + log_likelihoods
        weights = np.exp(logarithms - logarithms.max())
        self.probabilities = weights / weights.sum()

    def observe_lean(self) -> None:
        """Update the belief because the robot leans too far where its map is level; maps are rarely so wrong."""
        rare = 1 - self.config.confidence
        self.observe(np.log([rare, rare, rare, 1.0, 1.0]))

    def is_sure_of(self, state: MotionState) -> bool:
        """Whether a state is probable enough to be relied on."""
        return bool(self.probabilities[state] >= self.config.confidence)

    @property
    def state(self) -> MotionState:
        """The most probable state."""
        return MotionState(int(self.probabilities.argmax()))

    @property
    def knows_place(self) -> bool:
        """Whether the robot is almost surely neither carried nor blind; its pose then holds, even if wheels slip."""
        return bool(self.probabilities[MotionState.CARRIED :].sum() <= 1 - self.config.confidence)


def transition(distance: float, seconds: float, config: BeliefConfig) -> NDArray[np.float64]:
    """(5, 5) transition probabilities from each state (row) to each state (column) over a distance, m, and a time, s.

    Only observations lead from CARRIED or BLIND back to the other states.
    """
    rates = np.zeros((len(MotionState),) * 2)
    rates[MotionState.NOMINAL, [MotionState.SLIPPING, MotionState.HELD, MotionState.BLIND]] = (
        distance / config.fault_way
    )
    rates[[MotionState.SLIPPING, MotionState.HELD], MotionState.NOMINAL] = distance / RECOVERY_WAY
    rates[:, MotionState.CARRIED] = seconds / config.lift_time
    np.fill_diagonal(rates, 0.0)
    return np.asarray(expm(rates - np.diag(rates.sum(axis=1))))


def tiles_seen(explained: int, contradicted: int, missing: int, config: BeliefConfig) -> Values:
    """(5,) log-likelihoods of a frame, given how many tiles agree with the map, contradict it, or have no return."""
    here, elsewhere, blind = _by_place(explained, contradicted, missing, config)
    return place_bounded(np.array([here, here, here, elsewhere, blind]), config)


def disproves(explained: int, contradicted: int, config: BeliefConfig) -> bool:
    """Whether tiles show that frames were taken elsewhere; unlike one frame's, their evidence is not bounded."""
    here, elsewhere, _ = _by_place(explained, contradicted, 0, config)
    return bool(elsewhere - here > np.log(config.confidence / (1 - config.confidence)))


def _by_place(explained: int, contradicted: int, missing: int, config: BeliefConfig) -> Values:
    """(3,) log-likelihoods of tiles if the robot is where it believes it is, is elsewhere, or is blind."""
    rare = 1 - config.confidence
    here = SHOWN_HERE, rare, MISSING_HERE
    elsewhere = SHOWN_ELSEWHERE, CONTRADICTED_ELSEWHERE, MISSING_ELSEWHERE
    outcomes = np.log([here, elsewhere, (rare, rare, 1 - 2 * rare)])
    return outcomes @ (explained, contradicted, missing) / CORRELATED_TILES


def evidence_of_overlap(overlap: float, chance: float, covered: float = 1.0) -> float:
    """Log-likelihood ratio of a correct pose to a wrong one, from the fraction of points that fit.

    An overlap that ``chance`` alone explains is no evidence for either: the other points may be new ground, or dust.
    ``covered``: fraction of the image that the points cover.
    """
    return float(-np.log(chance) * covered * PARTS * max(0.0, overlap - chance))


def likelihood_of_view(shown: float, covered: float) -> float:
    """Log-likelihood of a frame that shows a fraction of the predicted surfaces, in a fraction of the image."""
    return float(covered * PARTS * (shown * np.log(SHOWN_HERE) + (1 - shown) * np.log(1 - SHOWN_HERE)))


def tiles_covered(pixels: Indices, width: int) -> float:
    """Fraction of an image's tiles in which (N, 2) pixels, row and column, lie; ``width`` of the image in pixels."""
    row, column = (pixels * TILES // width).T
    return len(np.unique(row * TILES + column)) / (TILES**2 * IMAGE_SHARE)


def place_bounded(log_likelihoods: Values, config: BeliefConfig) -> Values:
    """(5,) log-likelihoods, bounded: no single frame makes the robot surer of its place than ``confidence``.

    All parts of a frame mislead together if something new is in view, or if another place looks the same.
    """
    bounded, in_place = log_likelihoods.copy(), log_likelihoods[: MotionState.CARRIED].max()
    odds = np.log(config.confidence / (1 - config.confidence))
    bounded[MotionState.CARRIED :] = np.clip(bounded[MotionState.CARRIED :], in_place - odds, in_place + odds)
    return bounded
