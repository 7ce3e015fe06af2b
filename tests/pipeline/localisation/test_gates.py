import numpy as np

from pipeline.localisation.gates import CONFIDENCE, chi2_gate


def test_a_gate_accepts_as_many_gaussians_as_it_says():
    draws = np.random.default_rng(0).standard_normal((100_000, 6))
    for dimensions in (1, 3, 6):
        accepted = (draws[:, :dimensions] ** 2).sum(axis=1) <= chi2_gate(dimensions)
        assert abs(accepted.mean() - CONFIDENCE) < 0.002
