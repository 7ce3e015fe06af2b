"""A robot is carried elsewhere in the map of a short episode."""

from sarsim.settings import EpisodeConfig
from scripts.benchmarks.localisation_kidnappings import OUTCOMES, kidnap
from tests.sarsim.rooms import HOUSE


def test_every_time_something_comes_of_it_and_the_map_is_made_once(tmp_path):
    arena = tmp_path / "arena.xml"
    arena.write_text(HOUSE)
    config = EpisodeConfig(arena=str(arena), labels="truth", detector=None, steps=1)
    folder = tmp_path / "episode"
    assert not kidnap(config, 0, folder).total()
    made = (folder / "keyframes.npz").stat().st_mtime_ns
    counts = kidnap(config, 1, folder)
    assert set(counts) == set(OUTCOMES)
    assert counts.total() == 1
    assert counts["wrong"] == 0
    assert (folder / "keyframes.npz").stat().st_mtime_ns == made
