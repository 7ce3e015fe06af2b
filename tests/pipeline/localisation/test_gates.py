import numpy as np

from pipeline.localisation.gates import chi2_gate


def test_a_gate_accepts_as_many_gaussians_as_it_says():
    draws = np.random.default_rng(0).standard_normal((100_000, 6))
    for dimensions, confidence in ((1, 0.99), (3, 0.9), (6, 0.99)):
        accepted = (draws[:, :dimensions] ** 2).sum(axis=1) <= chi2_gate(dimensions, confidence)
        assert abs(accepted.mean() - confidence) < 0.002
