"""What the robot believes of its motion and its place: a hidden Markov filter over five states.

The states change at stated rates. Three observations tell them apart: how well a frame registers under what each
state says of the motion, how far the frame agrees with the map, and how far the wheels follow their command. Each is
a vector of log-likelihoods, so the order of independent observations does not matter.
"""

from enum import IntEnum, auto

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from pipeline.localisation.gates import CONFIDENCE


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
    """Its camera tells nothing, and its odometry has gone too far alone to be believed."""


WAY_BETWEEN, TIME_BETWEEN = 300.0, 3600.0
"""m driven from one slip, halt or loss of sight to the next, each by itself, and s from one lift to the next. In four
recorded drives there was no slip; a mission of an hour has at most one lift."""
ENOUGH_OVERLAP = 0.6
"""Share of what a frame shows that fits what was seen before although its pose is wrong: 0.45 of the points and 0.6
of the tiles in 281 frames of other places. With less overlap wheels may have slipped and a loop is doubtful."""
RARE = 1 - CONFIDENCE
TILE_OUTCOMES = np.log([[0.94, RARE, 0.05], [ENOUGH_OVERLAP, 0.2, 0.2], [RARE, RARE, 1 - 2 * RARE]])
"""Log-probabilities that an image tile in which the map expects something shows it, contradicts it, or has no return:
where the robot is where it thinks, elsewhere, and if it is blind. In 169 frames 0.99, 0.0002 and 0.01 were measured,
in arenas where nothing changes; tiles without a return come in patches, of what is dark or seen at a grazing angle,
so they count for less. The second row was measured in 281 frames of other places."""
TILES = 32
"""Tiles across an image, along each side of which depths are compared: 1.8° of the Xtion."""
CORRELATED_TILES = 3**2
"""Number of tiles that count as one: each is compared with all depths within one tile around it."""
LEANED = np.log([RARE, RARE, RARE, 1.0, 1.0])
"""Log-likelihoods of a robot that leans too far where its map is level: a map is so wrong once in a hundred."""


class Belief:
    """Probabilities of the five states.

    Attributes:
        probabilities: (5,) of each :class:`MotionState`.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Be sure of the pose and of the motion."""
        self.probabilities = np.eye(len(MotionState))[MotionState.NOMINAL]

    def predict(self, way: float, seconds: float) -> None:
        """Let the state change while the wheels measure a way, m, in some time, s."""
        self.probabilities = self.probabilities @ transition(way, seconds)

    def observe(self, log_likelihoods: NDArray[np.float64]) -> None:
        """Take (5,) log-likelihoods of an observation into account, up to a common constant."""
        with np.errstate(divide="ignore"):  # a state may be impossible
            logarithms = np.log(self.probabilities) + log_likelihoods
        weights = np.exp(logarithms - logarithms.max())
        self.probabilities = weights / weights.sum()

    def is_sure_of(self, state: MotionState) -> bool:
        """Whether a state is as probable as ``CONFIDENCE``."""
        return bool(self.probabilities[state] >= CONFIDENCE)

    @property
    def state(self) -> MotionState:
        """The most probable state."""
        return MotionState(int(self.probabilities.argmax()))

    @property
    def knows_place(self) -> bool:
        """Whether the robot is for sure neither carried nor blind: its pose holds, also where wheels slip."""
        return bool(self.probabilities[MotionState.CARRIED :].sum() <= RARE)


def transition(way: float, seconds: float) -> NDArray[np.float64]:
    """(5, 5) probabilities of a state, by row, to be followed by another one after a way, m, and a time, s.

    Slips and halts last for about a metre by the wheels. Only what is observed ends a lift or a loss of sight.
    """
    rates = np.zeros((len(MotionState),) * 2)
    rates[MotionState.NOMINAL, [MotionState.SLIPPING, MotionState.HELD, MotionState.BLIND]] = way / WAY_BETWEEN
    rates[[MotionState.SLIPPING, MotionState.HELD], MotionState.NOMINAL] = way
    rates[:, MotionState.CARRIED] = seconds / TIME_BETWEEN
    np.fill_diagonal(rates, 0.0)
    return np.asarray(expm(rates - np.diag(rates.sum(axis=1))))


def tiles_seen(explained: int, contradicted: int, missing: int) -> NDArray[np.float64]:
    """(5,) log-likelihoods of a frame of which tiles show what the map expects, contradict it, or have no return."""
    here, elsewhere, blind = TILE_OUTCOMES @ (explained, contradicted, missing) / CORRELATED_TILES
    return place_bounded(np.array([here, here, here, elsewhere, blind]))


def evidence_of_overlap(overlap: float) -> float:
    """Logarithm of how much likelier a frame with this share of its points seen before is at a right pose.

    A share that chance gives tells nothing: the rest may be new ground, or dust. An image is taken to be 4 to 3.
    """
    parts = TILES**2 * 0.75 / CORRELATED_TILES
    return float(-np.log(ENOUGH_OVERLAP) * parts * max(0.0, overlap - ENOUGH_OVERLAP))


def place_bounded(log_likelihoods: NDArray[np.float64]) -> NDArray[np.float64]:
    """(5,) log-likelihoods of a frame, which alone tells no more of the robot's place than ``CONFIDENCE``.

    All of its parts err together where something new stands in view, or where another place looks alike.
    """
    bounded, known = log_likelihoods.copy(), log_likelihoods[: MotionState.CARRIED].max()
    odds = np.log(CONFIDENCE / RARE)
    bounded[MotionState.CARRIED :] = np.clip(bounded[MotionState.CARRIED :], known - odds, known + odds)
    return bounded


def disproves(explained: int, contradicted: int) -> bool:
    """Whether tiles show, without any bound, that frames were taken elsewhere."""
    here, elsewhere, _ = TILE_OUTCOMES @ (explained, contradicted, 0) / CORRELATED_TILES
    return bool(elsewhere - here > np.log(CONFIDENCE / RARE))
