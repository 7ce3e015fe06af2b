import numpy as np
import pytest

from pipeline.errors import InputError
from sarsim.arenas.load import load_arena
from scripts.benchmarks.goals import figures, measure, sample, table
from scripts.benchmarks.settings import GoalsSettings

RUNS = {
    "random:0": [
        {"way_m": 6.0, "shortest_m": 5.0, "time_s": 20.0, "refused": [], "collisions": 0},
        {"way_m": 2.0, "shortest_m": 8.0, "time_s": 90.0, "refused": ["it is blocked"], "collisions": 1},
    ],
    "random:1": [{"way_m": 14.0, "shortest_m": 10.0, "time_s": 40.0, "refused": [], "collisions": 0}],
}


def test_only_goals_that_were_reached_have_a_way():
    found = figures(RUNS)
    assert found["goals"] == 3
    assert found["reached"] == pytest.approx(2 / 3) and found["contacts"] == pytest.approx(1 / 3)
    assert found["way_over_shortest.median"] == pytest.approx(1.3)
    assert found["way_over_shortest.worst"] == pytest.approx(1.4)
    assert table(RUNS, found).row_count == 3


def test_goals_lie_on_drivable_ground_as_far_away_as_they_should_and_are_the_same_again():
    places = sample("random:1", 5, 1, "pioneer3at")
    away = np.linalg.norm(places - load_arena("random:1").T_world_start[:2, 3], axis=1)
    assert len(places) == 5 and (away >= 5).all() and (away <= 15).all()
    np.testing.assert_array_equal(places, sample("random:1", 5, 1, "pioneer3at"))


@pytest.mark.parametrize("setting", ["arenas", "goals"])
def test_there_is_something_to_drive(setting):
    with pytest.raises(InputError, match=setting):
        measure(GoalsSettings(**{setting: 0}))
