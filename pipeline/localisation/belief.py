"""The robot's belief about its motion and its position: a hidden Markov filter over five states.

The states change at configured rates. Three observations distinguish the states: the fit of a frame registered under
each state's motion, the frame's agreement with the map, and whether the robot leans too far where the map is level.
Each observation is a vector of log-likelihoods, so the order of independent observations does not matter.
"""

from enum import IntEnum, auto

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from pipeline.arrays import Indices, Values
from pipeline.localisation.config import BeliefConfig

RECOVERY_DISTANCE = 1.0
"""Mean distance that the wheels measure during a slip, or while the robot is held, m."""
TILES = 32
"""Number of tiles, 1.8° wide for the Xtion, in a row of an image; their depths are compared with the map."""
CORRELATED_TILES = 9
"""Number of tiles that are treated as one observation, because each is compared in a 3 × 3 window."""
HEIGHT_TO_WIDTH = 0.75
"""Number of tiles in an image divided by the square of ``TILES``, for an aspect ratio of 4:3."""
OBSERVATIONS_PER_IMAGE = TILES**2 * HEIGHT_TO_WIDTH / CORRELATED_TILES
"""Number of independent observations in an image."""
SHOWN_HERE, MISSING_HERE = 0.94, 0.05
"""Probabilities that a tile for which the map predicts a surface shows this surface, or has no return, if the robot
is at its estimated pose. In 169 frames of unchanging arenas, 0.99 and 0.01 were measured, and 0.02% of the tiles
contradicted the map. Tiles without a return are clustered where surfaces are dark or seen at a grazing angle, so they
have less weight."""
SHOWN_ELSEWHERE, CONTRADICTED_ELSEWHERE, MISSING_ELSEWHERE = 0.6, 0.2, 0.2
"""Probabilities that a tile for which the map predicts a surface agrees with the map, contradicts the map or has no
return, if the frame was taken elsewhere. They were measured in 281 frames."""


class MotionState(IntEnum):
    """The robot's state of motion."""

    NOMINAL = 0
    """The robot moves as its odometry reports."""
    SLIPPING = auto()
    """The robot moves, but no farther than its wheels measure."""
    HELD = auto()
    """The robot does not move, whatever its wheels measure."""
    CARRIED = auto()
    """The robot was picked up and set down elsewhere."""
    BLIND = auto()
    """The camera shows nothing, and the robot has moved too far on odometry alone for its pose to be trusted."""


class Belief:
    """The robot's belief about its state of motion.

    Attributes:
        probabilities: (5,) probability of each :class:`MotionState`.
        config: rates of the transitions between states, and the required confidence.
    """

    def __init__(self, config: BeliefConfig = BeliefConfig()) -> None:
        self.config = config
        self.restart()

    def restart(self) -> None:
        """Reset the belief to certainty that the pose is right and the motion nominal."""
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
        """Update the belief after the robot leaned too far where the map is level; such errors are rare in maps."""
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
        """Whether the robot is almost certainly neither carried nor blind.

        Its pose is then valid even if its wheels slip.
        """
        return bool(self.probabilities[MotionState.CARRIED :].sum() <= 1 - self.config.confidence)


def transition(distance: float, seconds: float, config: BeliefConfig) -> NDArray[np.float64]:
    """(5, 5) transition probabilities from each state (row) to each state (column) over a distance, m, and a time, s.

    Only observations lead from CARRIED or BLIND back to the first three states.
    """
    rates = np.zeros((len(MotionState),) * 2)
    rates[MotionState.NOMINAL, [MotionState.SLIPPING, MotionState.HELD, MotionState.BLIND]] = (
        distance / config.distance_between_faults
    )
    rates[[MotionState.SLIPPING, MotionState.HELD], MotionState.NOMINAL] = distance / RECOVERY_DISTANCE
    rates[:, MotionState.CARRIED] = seconds / config.lift_time
    np.fill_diagonal(rates, 0.0)
    return np.asarray(expm(rates - np.diag(rates.sum(axis=1))))


def tile_log_likelihoods(explained: int, contradicted: int, missing: int, config: BeliefConfig) -> Values:
    """(5,) log-likelihoods of a frame under each state, given its numbers of tiles.

    Args:
        explained, contradicted: numbers of tiles that agree with the map and that contradict it.
        missing: number of tiles without a return although the map predicts one.
        config: settings of the belief.
    """
    here, elsewhere, blind = _log_likelihoods_by_place(explained, contradicted, missing, config)
    return bounded_log_likelihoods(np.array([here, here, here, elsewhere, blind]), config)


def disproves(explained: int, contradicted: int, config: BeliefConfig) -> bool:
    """Whether the tiles of several frames show that the frames were taken elsewhere.

    Unlike the evidence of a single frame, this evidence is not bounded.
    """
    here, elsewhere, _ = _log_likelihoods_by_place(explained, contradicted, 0, config)
    return bool(elsewhere - here > np.log(config.confidence / (1 - config.confidence)))


def _log_likelihoods_by_place(explained: int, contradicted: int, missing: int, config: BeliefConfig) -> Values:
    """(3,) log-likelihoods of tiles if the robot is at its estimated pose, elsewhere, or blind."""
    rare = 1 - config.confidence
    here = SHOWN_HERE, rare, MISSING_HERE
    elsewhere = SHOWN_ELSEWHERE, CONTRADICTED_ELSEWHERE, MISSING_ELSEWHERE
    outcomes = np.log([here, elsewhere, (rare, rare, 1 - 2 * rare)])
    return outcomes @ (explained, contradicted, missing) / CORRELATED_TILES


def overlap_log_likelihood_ratio(overlap: float, chance: float, covered: float = 1.0) -> float:
    """Log-likelihood ratio of a correct pose to a wrong one, from the fraction of points that fit.

    An overlap of up to ``chance`` is evidence for neither pose, because the points that do not fit may be new ground
    or dust. ``covered``: fraction of the image that the points cover.
    """
    return float(-np.log(chance) * covered * OBSERVATIONS_PER_IMAGE * max(0.0, overlap - chance))


def view_log_likelihoods(shown: Values, covered: float) -> Values:
    """(N,) log-likelihoods of a frame under N poses.

    Args:
        shown: (N,) fraction of the surfaces predicted for each pose that the frame shows.
        covered: fraction of the image that these surfaces cover.
    """
    return np.asarray(
        covered * OBSERVATIONS_PER_IMAGE * (shown * np.log(SHOWN_HERE) + (1 - shown) * np.log(1 - SHOWN_HERE))
    )


def tiles_covered(pixels: Indices, width: int) -> float:
    """Fraction of an image's tiles that contain at least one of the pixels.

    Args:
        pixels: (N, 2) row and column.
        width: width of the image, pixels.
    """
    row, column = (pixels * TILES // width).T
    return len(np.unique(row * TILES + column)) / (TILES**2 * HEIGHT_TO_WIDTH)


def bounded_log_likelihoods(log_likelihoods: Values, config: BeliefConfig) -> Values:
    """(5,) log-likelihoods, bounded so that no single frame makes the robot surer of its place than ``confidence``.

    The bound is needed because all parts of a frame are misleading if something new is in view, or if another place
    looks the same.
    """
    bounded, in_place = log_likelihoods.copy(), log_likelihoods[: MotionState.CARRIED].max()
    odds = np.log(config.confidence / (1 - config.confidence))
    bounded[MotionState.CARRIED :] = np.clip(bounded[MotionState.CARRIED :], in_place - odds, in_place + odds)
    return bounded
