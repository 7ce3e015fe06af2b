"""Repetitions in lanes: who drives where, what is counted, and one true traverse."""

from contextlib import closing

import mujoco
import numpy as np
import pytest

from pipeline.errors import InputError
from sarsim.plugins.lanes.lanes import LANES
from scripts.benchmarks import lanes
from scripts.benchmarks.lanes import LaneDrive, LaneRepetitions, LaneTry, figures, lane_from, measure
from scripts.benchmarks.settings import LanesSettings

REACHED, FALLEN = LaneTry(1, "reached", 30.0, 0), LaneTry(-1, "tipped", None, 2)
LEFT, LATE = LaneTry(1, "given_up", None, 1), LaneTry(-1, "time", 50.0, 0)
TRIES = {"centre": [REACHED, FALLEN, LEFT, LATE], "krails": [], "door": [LEFT]}


@pytest.mark.parametrize(
    ("made", "needs"),
    [(REACHED, False), (FALLEN, True), (LEFT, True), (LATE, True), (LaneTry(1, "held", 9.0, 0), False)],
)
def test_a_robot_is_touched_if_it_is_not_across_or_cannot_go_on(made, needs):
    assert made.needs_reset is needs


def test_figures_of_tries():
    found = figures(TRIES, 4)
    assert {k: v for k, v in found.items() if k.startswith("centre")} == {
        "centre.repetitions": 4,
        "centre.attempted": 4,
        "centre.successful": 2,
        "centre.posts": 3,
        "centre.resets": 3,
        "centre.tipped": 1,
        "centre.seconds.median": 40.0,
    }
    assert found["krails.attempted"] == found["door.successful"] == 0
    assert "door.seconds.median" not in found


def test_directions_alternate_and_a_reset_sets_up_anew(monkeypatch):
    made, done, closed = [REACHED, LEFT, FALLEN, REACHED], [], []

    class Drive:
        def __init__(self, lane, end, settings, seed):
            self.name = lane, end, seed

        def go(self, towards):
            done.append((*self.name, towards))
            return made[len(done) - 1]

        def close(self):
            closed.append(self.name)

    monkeypatch.setattr(lanes, "LaneDrive", Drive)
    with closing(LaneRepetitions("door", LanesSettings(seed=7))) as repetitions:
        assert [repetitions.next_try() for _ in made] == made
    # One drive there and back that fails; one there that fails; one back.
    assert done == [("door", -1, 7, 1), ("door", -1, 7, -1), ("door", -1, 9, 1), ("door", 1, 10, -1)]
    assert closed == [("door", -1, 7), ("door", -1, 9), ("door", 1, 10)]


def test_lanes_that_no_pioneer_can_drive_are_not_tried():
    result = measure(LanesSettings(lanes=("krails", "pitch_roll")))
    assert result.figures["krails.attempted"] == result.figures["pitch_roll.successful"] == 0
    assert "0.063 m" in result.details["cannot"]["pitch_roll"]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (LanesSettings(lanes=("moat",)), "--lanes moat: .*avoid_holes"),
        (LanesSettings(repetitions=0), "--repetitions 0:"),
        (LanesSettings(robot="none.xml", lanes=("door",)), "--robot none.xml: no such robot or file"),
    ],
)
def test_bad_settings_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        measure(settings)


@pytest.mark.parametrize("lane", LANES)
def test_the_other_end_is_a_start_too(lane):
    near, far = (lane_from(lane, end) for end in (-1, 1))
    a, b = near.T_world_start, far.T_world_start
    model = mujoco.MjModel.from_xml_string(far.to_xml())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    top, geom = b[:3, 3] + [0, 0, 0.3], np.zeros(1, np.int32)
    below = mujoco.mj_ray(model, data, top, np.array([0, 0, -1.0]), None, 1, -1, geom, None)
    assert below == pytest.approx(0.3, abs=1e-3)
    assert a[0, 3] < -LANES[lane].end_distance and b[0, 3] > LANES[lane].end_distance
    if lane not in ("alleys", "centre"):  # whose ways begin sideways
        assert b[:3, 0] == pytest.approx([-1, 0, 0], abs=1e-6) and a[:3, 0] == pytest.approx([1, 0, 0], abs=1e-6)


def test_a_robot_drives_through_a_door(monkeypatch):
    def close_to_the_door(lane, end):
        arena = lane_from(lane, end)
        start = arena.mjcf_model.find("site", "start")
        start.pos = 1.2, 0.62, start.pos[2]
        return arena

    monkeypatch.setattr(lanes, "lane_from", close_to_the_door)
    with closing(LaneDrive("door", 1, LanesSettings(labels="truth", detector=None), seed=0)) as drive:
        made = drive.go(-1)
    assert made.ended == "reached" and made.posts == 0
    assert made.seconds is not None and 3 < made.seconds < 100
