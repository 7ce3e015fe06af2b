"""The hidden Markov filter of the robot's motion and place, by hand and against an independent forward algorithm."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.integrate import solve_ivp

from pipeline.localisation.belief import (
    Belief,
    MotionState,
    bounded_log_likelihoods,
    disproves,
    tile_log_likelihoods,
    transition,
)
from pipeline.localisation.config import BeliefConfig

CONFIG = BeliefConfig()
STATES = len(MotionState)
SURE = np.log(0.99 / 0.01)
likelihoods = hnp.arrays(np.float64, STATES, elements=st.floats(-20, 0))
ways = st.floats(0, 5)


def test_a_robot_that_neither_moves_nor_waits_stays_as_it_is() -> None:
    np.testing.assert_array_equal(transition(0.0, 0.0, CONFIG), np.eye(STATES))


def test_three_metres_on_the_odometry_alone_are_too_many() -> None:
    """Sight is lost once in 300 m: exp(-3 / 300) is 0.99, of which slips and halts that end take a little."""
    belief = Belief()
    belief.predict(2.9, 0.0)
    assert belief.knows_place
    belief.predict(0.2, 0.0)
    assert not belief.knows_place
    assert belief.state is MotionState.NOMINAL


def test_slips_are_as_frequent_as_stated_and_end() -> None:
    short = transition(0.003, 0.0, CONFIG)
    assert short[MotionState.NOMINAL, MotionState.SLIPPING] == pytest.approx(1e-5, rel=0.01)
    assert short[MotionState.SLIPPING, MotionState.NOMINAL] == pytest.approx(0.003, rel=0.01)
    assert transition(0.0, 3.6, CONFIG)[MotionState.HELD, MotionState.CARRIED] == pytest.approx(1e-3, rel=0.01)


def test_bayes_by_hand() -> None:
    belief = Belief()
    belief.probabilities = np.array([0.5, 0.25, 0.0, 0.25, 0.0])
    belief.observe(np.log([0.2, 0.4, 0.9, 0.8, 0.1]))
    np.testing.assert_allclose(belief.probabilities, [0.25, 0.25, 0.0, 0.5, 0.0])
    assert belief.state is MotionState.CARRIED and not belief.knows_place
    assert not belief.is_sure_of(MotionState.CARRIED)


def test_what_is_impossible_stays_so_however_well_it_explains_a_frame() -> None:
    belief = Belief()
    belief.observe(np.array([-2000.0, -np.inf, 0.0, 0.0, 0.0]))
    np.testing.assert_array_equal(belief.probabilities, np.eye(STATES)[MotionState.NOMINAL])


def test_a_frame_alone_convinces_nobody_and_three_do() -> None:
    belief = Belief()
    belief.predict(0.0, 10.0)
    sure = []
    for _ in range(4):
        belief.observe(tile_log_likelihoods(explained=50, contradicted=200, missing=0, config=CONFIG))
        sure.append((belief.knows_place, belief.is_sure_of(MotionState.CARRIED)))
    assert sure == [(False, False), (False, False), (False, True), (False, True)]


def test_tiles_without_a_return_are_of_a_blind_camera_and_not_of_a_lift() -> None:
    likely = tile_log_likelihoods(explained=0, contradicted=0, missing=300, config=CONFIG)
    assert likely[MotionState.BLIND] - likely[MotionState.NOMINAL] == pytest.approx(SURE)
    few = tile_log_likelihoods(explained=9, contradicted=0, missing=0, config=CONFIG)
    assert few[MotionState.CARRIED] - few[MotionState.NOMINAL] == pytest.approx(np.log(0.6 / 0.94))
    np.testing.assert_array_equal(tile_log_likelihoods(0, 0, 0, CONFIG), 0.0)


@pytest.mark.parametrize(
    ("explained", "contradicted", "expected"), [(300, 10, False), (100, 100, True), (0, 9, False)]
)
def test_frames_together_disprove_a_place(explained: int, contradicted: int, expected: bool) -> None:
    assert disproves(explained, contradicted, CONFIG) == expected


@settings(max_examples=50, deadline=None)
@given(likelihoods)
def test_a_frame_makes_no_surer_of_the_place_than_the_confidence(likely: np.ndarray) -> None:
    bounded = bounded_log_likelihoods(likely, CONFIG)
    np.testing.assert_array_equal(bounded[: MotionState.CARRIED], likely[: MotionState.CARRIED])
    assert (np.abs(bounded[MotionState.CARRIED :] - likely[: MotionState.CARRIED].max()) <= SURE + 1e-9).all()


@settings(max_examples=50, deadline=None)
@given(ways, ways, likelihoods, likelihoods)
def test_the_posterior_is_one_of_probabilities_and_independent_frames_come_in_any_order(way, seconds, a, b) -> None:
    beliefs = []
    for first, second in ((a, b), (b, a)):
        belief = Belief()
        belief.predict(way, seconds)
        belief.observe(first)
        belief.observe(second)
        assert belief.probabilities.sum() == pytest.approx(1.0)
        assert (belief.probabilities >= 0).all()
        beliefs.append(belief.probabilities)
    np.testing.assert_allclose(*beliefs, atol=1e-12)


@settings(max_examples=10, deadline=None)
@given(st.lists(st.tuples(ways, ways, likelihoods), min_size=1, max_size=4))
def test_it_is_the_forward_algorithm_over_all_paths(drive: list[tuple[float, float, np.ndarray]]) -> None:
    """The sum over every path of states, whose transitions come from the differential equation of the rates."""
    belief, matrices = Belief(), []
    for way, seconds, likely in drive:
        belief.predict(way, seconds)
        belief.observe(likely)
        matrices.append(np.array([_followed(state, way, seconds) for state in range(STATES)]))
    weights = np.zeros(STATES)
    for path in product(range(STATES), repeat=len(drive)):
        before, weight = MotionState.NOMINAL, 1.0
        for state, matrix, (_, _, likely) in zip(path, matrices, drive, strict=True):
            weight *= matrix[before, state] * np.exp(likely[state])
            before = state
        weights[path[-1]] += weight
    np.testing.assert_allclose(belief.probabilities, weights / weights.sum(), atol=1e-6)


def _followed(state: int, way: float, seconds: float) -> np.ndarray:
    """(5,) probabilities after a way, m, and a time, s, which begin with one state."""

    def change(_: float, p: np.ndarray) -> np.ndarray:
        nominal, slipping, held, _, blind = p
        begin, lift = way * nominal / 300, seconds / 3600
        flow = [way * (slipping + held) - 3 * begin, begin - way * slipping, begin - way * held, 0.0, begin]
        lifted = np.array([nominal, slipping, held, 0.0, blind]) * lift
        return np.array(flow) - lifted + np.eye(STATES)[MotionState.CARRIED] * lifted.sum()

    return solve_ivp(change, (0, 1), np.eye(STATES)[state], rtol=1e-9, atol=1e-12).y[:, -1]
