"""What the robot believes of its motion and its place: a hidden Markov filter over five states.

The states change at stated rates. Three observations distinguish them: how well a frame registers under what each
state says of the motion, how far the frame agrees with the map, and how far the wheels follow their command. Each is
a vector of log-likelihoods, so the order of independent observations does not matter.
"""

from enum import IntEnum, auto

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from pipeline.arrays import Indices, Values
from pipeline.localisation.config import BeliefConfig


class MotionState(IntEnum):
    """What the robot's motion is like."""

    NOMINAL = 0
    """It moves as its odometry says."""
    SLIPPING = auto()
    """It has moved, by no more than its wheels say."""
    HELD = auto()
    """It stays, whatever its wheels or its commands say."""
    CARRIED = auto()
    """It was set down elsewhere."""
    BLIND = auto()
    """Its camera shows nothing, and its odometry has gone too far alone to be believed."""


class Belief:
    """Probabilities of the five states.

    Attributes:
        probabilities: (5,) of each :class:`MotionState`.
        config: how often the motion goes wrong, and how far a frame is believed.
    """

    def __init__(self, config: BeliefConfig = BeliefConfig()) -> None:
        self.config = config
        self.restart()

    def restart(self) -> None:
        """Become certain of the pose and of the motion."""
        self.probabilities = np.eye(len(MotionState))[MotionState.NOMINAL]

    def predict(self, way: float, seconds: float) -> None:
        """Let the state change while the wheels measure a way, m, in some time, s."""
        self.probabilities = self.probabilities @ transition(way, seconds, self.config)

    def observe(self, log_likelihoods: Values) -> None:
        """Take (5,) log-likelihoods of an observation into account, up to a common constant."""
        with np.errstate(divide="ignore"):  # a state may be impossible
            logarithms = np.log(self.probabilities) + log_likelihoods
        weights = np.exp(logarithms - logarithms.max())
        self.probabilities = weights / weights.sum()

    def observe_lean(self) -> None:
        """Take into account that the robot leans too far where its map is level; maps are rarely so wrong."""
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
        """Whether the robot was certainly not carried and is not blind; its pose then holds, even if wheels slip."""
        return bool(self.probabilities[MotionState.CARRIED :].sum() <= 1 - self.config.confidence)


def transition(way: float, seconds: float, config: BeliefConfig) -> NDArray[np.float64]:
    """(5, 5) probabilities of a state, by row, to be followed by another one after a way, m, and a time, s.

    Only what is observed ends a lift or a loss of sight.
    """
    rates = np.zeros((len(MotionState),) * 2)
    rates[MotionState.NOMINAL, [MotionState.SLIPPING, MotionState.HELD, MotionState.BLIND]] = way / config.fault_way
    rates[[MotionState.SLIPPING, MotionState.HELD], MotionState.NOMINAL] = way / config.recovery_way
    rates[:, MotionState.CARRIED] = seconds / config.lift_time
    np.fill_diagonal(rates, 0.0)
    return np.asarray(expm(rates - np.diag(rates.sum(axis=1))))


def tiles_seen(explained: int, contradicted: int, missing: int, config: BeliefConfig) -> Values:
    """(5,) log-likelihoods of a frame of which tiles show what the map expects, contradict it, or have no return."""
    here, elsewhere, blind = _by_place(explained, contradicted, missing, config)
    return place_bounded(np.array([here, here, here, elsewhere, blind]), config)


def disproves(explained: int, contradicted: int, config: BeliefConfig) -> bool:
    """Whether tiles show, without any bound, that frames were taken elsewhere."""
    here, elsewhere, _ = _by_place(explained, contradicted, 0, config)
    return bool(elsewhere - here > np.log(config.confidence / (1 - config.confidence)))


def _by_place(explained: int, contradicted: int, missing: int, config: BeliefConfig) -> Values:
    """(3,) log-likelihoods of tiles if the robot is where it thinks, elsewhere, and if it is blind."""
    rare = 1 - config.confidence
    here = config.shown_here, rare, config.missing_here
    elsewhere = config.shown_elsewhere, config.contradicted_elsewhere, config.missing_elsewhere
    outcomes = np.log([here, elsewhere, (rare, rare, 1 - 2 * rare)])
    return outcomes @ (explained, contradicted, missing) / config.correlated_tiles


def evidence_of_overlap(overlap: float, chance: float, config: BeliefConfig, covered: float = 1.0) -> float:
    """Logarithm of how much likelier it is at a correct pose that this share of the points fits.

    A share that ``chance`` alone explains is no evidence: the rest may be new ground, or dust. ``covered``: share of
    the image in which the points lie.
    """
    parts = covered * config.tiles**2 * config.image_share / config.correlated_tiles
    return float(-np.log(chance) * parts * max(0.0, overlap - chance))


def tiles_covered(pixels: Indices, width: int, config: BeliefConfig) -> float:
    """Share of an image of a ``width`` in whose tiles (N, 2) pixels lie, rows and columns."""
    row, column = (pixels * config.tiles // width).T
    return len(np.unique(row * config.tiles + column)) / (config.tiles**2 * config.image_share)


def place_bounded(log_likelihoods: Values, config: BeliefConfig) -> Values:
    """(5,) log-likelihoods of a frame, which alone makes the robot no surer of its place than ``confidence``.

    All parts of a frame are wrong together if something new is in view, or if another place looks the same.
    """
    bounded, in_place = log_likelihoods.copy(), log_likelihoods[: MotionState.CARRIED].max()
    odds = np.log(config.confidence / (1 - config.confidence))
    bounded[MotionState.CARRIED :] = np.clip(bounded[MotionState.CARRIED :], in_place - odds, in_place + odds)
    return bounded
