import numpy as np
import pytest
from numpy.testing import assert_allclose

from sarsim.sensors.inertial import CALIBRATION_TIME, DRIFT_TIME, MTI_300_GYRO, InertialErrorModel
from sarsim.sensors.inertial import InertialTriad as Triad
from tests.sarsim.sensors.no_noise import NoNoise

TRUE = np.array([0.1, -0.2, 9.0])


def triads(errors: InertialErrorModel, number: int) -> list[Triad]:
    return [Triad(errors, np.random.default_rng(seed)) for seed in range(number)]


def test_without_noise_it_measures_the_truth():
    assert_allclose(Triad(MTI_300_GYRO, NoNoise()).measure(TRUE, 0.02), TRUE)


def test_a_scale_error_is_of_the_axis_and_constant():
    triad = Triad(InertialErrorModel(scale_sigma=0.01), np.random.default_rng(0))
    factors = 1 + 0.01 * np.random.default_rng(0).standard_normal(3)
    for factor in (1.0, -2.0):
        assert_allclose(triad.measure(factor * TRUE, 0.02), factor * factors * TRUE)


def test_offsets_have_the_models_size():
    offsets = np.array(
        [triad.measure(np.zeros(3), 0.02) for triad in triads(InertialErrorModel(bias_sigma=0.1), 300)]
    )
    assert_allclose(offsets.std(), 0.1, rtol=0.1)


@pytest.mark.parametrize("dt", [0.01, 0.1])
def test_noise_makes_the_integral_walk_by_its_density_over_the_square_root_of_two(dt):
    seconds = 2.0
    triad = Triad(InertialErrorModel(noise_density=0.3), np.random.default_rng(0))
    steps = np.array([triad.measure(np.zeros(3), dt) for _ in range(round(200 * seconds / dt))])
    integrals = steps.reshape(200, -1, 3).sum(axis=1) * dt
    assert_allclose(integrals.std(), 0.3 * np.sqrt(seconds / 2), rtol=0.1)


def test_calibration_leaves_the_mean_of_its_noise():
    errors = InertialErrorModel(noise_density=MTI_300_GYRO.noise_density)
    means = [triad.measure(np.zeros(3), CALIBRATION_TIME) for triad in triads(errors, 300)]
    assert_allclose(np.std(means), MTI_300_GYRO.bias_sigma, rtol=0.1)


def test_the_drift_begins_at_nothing_and_has_the_models_allan_deviation():
    triad = Triad(InertialErrorModel(bias_stability=1.0), np.random.default_rng(0))
    dt = DRIFT_TIME / 20
    assert np.abs(triad.measure(np.zeros(3), 1e-9)).max() < 1e-3
    bias = np.array([triad.measure(np.zeros(3), dt) for _ in range(40_000)])
    means = bias[: len(bias) // 38 * 38].reshape(-1, 38, 3).mean(axis=1)  # over 1.9 of its time
    assert_allclose(np.sqrt(np.mean(np.diff(means, axis=0) ** 2) / 2), 1.0, rtol=0.05)
