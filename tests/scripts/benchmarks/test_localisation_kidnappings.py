"""A robot is carried elsewhere in the map of a short episode."""

from collections import Counter

from sarsim.scripts.benchmarks.localisation_kidnappings import OUTCOMES, kidnap
from sarsim.settings import EpisodeConfig


def test_every_time_something_comes_of_it_and_the_map_is_made_once(tmp_path):
    config = EpisodeConfig(labels="truth", detector=None, steps=4)
    counts = kidnap(config, 1, tmp_path)
    assert set(counts) == set(OUTCOMES)
    assert counts.total() == 1
    assert counts["wrong"] == 0
    made = (tmp_path / "keyframes.npz").stat().st_mtime_ns
    assert kidnap(config, 1, tmp_path) == Counter(counts)
    assert (tmp_path / "keyframes.npz").stat().st_mtime_ns == made
