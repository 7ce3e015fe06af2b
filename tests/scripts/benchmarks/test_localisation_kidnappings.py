"""A robot is carried elsewhere in the map of a short episode."""

from sarsim.settings import EpisodeConfig
from scripts.benchmarks import localisation_kidnappings
from scripts.benchmarks.localisation_kidnappings import OUTCOMES, kidnap
from tests.sarsim.rooms import box, room

ROOM = room((-1.0, 2.2), (-1.0, 1.4), box((1.2, 1.3), (-1.0, -0.4)))


def test_a_robot_finds_its_place_in_a_room_and_the_map_is_made_once(tmp_path, monkeypatch):
    arena, folder = tmp_path / "arena.xml", tmp_path / "episode"
    arena.write_text(ROOM)
    config = EpisodeConfig(arena=str(arena), labels="truth", detector=None, steps=2)
    counts = kidnap(config, 1, folder)
    assert set(counts) == set(OUTCOMES)
    assert counts.total() == 1 and counts["found"] + counts["found_worse"] == 1
    made = (folder / "keyframes.npz").stat().st_mtime_ns
    monkeypatch.setattr(localisation_kidnappings, "placed", lambda *given: None)
    kidnap(config, 0, folder)
    assert (folder / "keyframes.npz").stat().st_mtime_ns == made
