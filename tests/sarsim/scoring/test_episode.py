"""The figures of an episode's score."""

import itertools

import numpy as np
import pytest

from pipeline.explorer import Explorer
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.mapper import Mapper
from pipeline.robot import Velocity
from pipeline.semantic_map.classifier import TruthClassifier
from sarsim.arenas.load import load_arena
from sarsim.scoring.episode import EpisodeScore
from sarsim.scoring.progress import ExploredCurve
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig


@pytest.fixture(scope="module")
def score():
    """The score of two steps in the NIST arena."""
    robot = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(odometry="truth"), seed=0)
    explorer = Explorer(robot, Mapper(robot.model, TruthClassifier(), localisation=OdometryLocalisation()))
    score = EpisodeScore(robot, explorer)
    explorer.watch(score)
    for _ in range(2):
        explorer.drive(explorer.step())
    yield score
    robot.close()


def test_progress_has_an_entry_for_each_keyframe_also_of_those_on_the_way(score):
    times, ways, shares = score.progress
    assert len(times) == score.figures()["localisation"]["keyframes"] > 2 * 2
    assert times[0] == 0  # before anything was driven
    assert all(a < b for a, b in itertools.pairwise(times))
    assert ways[0] == 0 and (np.diff(ways) >= 0).all() and 0 < ways[-1] <= score.figures()["navigation"]["distance_m"]
    assert all(a <= b for a, b in itertools.pairwise(shares))
    assert shares[-1] == score.coverage.fraction
    assert 0 < shares[0] < 0.9


def test_what_was_seen_is_counted_on_drivable_ground_alone(score):
    surface = score.surface
    assert (score.coverage.seen & ~surface.drivable).any()
    assert score.coverage.fraction == (score.coverage.seen & surface.drivable).sum() / surface.drivable.sum()
    assert not score.coverage.seen[np.isnan(surface.height)].any()


def test_times_to_see_most_are_those_of_the_first_keyframes_with_so_much(score, monkeypatch):
    assert not {"t90_s", "t99_s"} & set(score.figures()["exploration"])
    monkeypatch.setattr(EpisodeScore, "progress", ExploredCurve(*np.array([[0, 7, 9], [0, 2, 3], [0.3, 0.9, 0.95]])))
    assert score.figures()["exploration"]["t90_s"] == 7.0
    assert "t99_s" not in score.figures()["exploration"]
    monkeypatch.setattr(EpisodeScore, "progress", ExploredCurve(*np.array([[0, 7], [0, 2], [0.3, 0.995]])))
    assert {score.figures()["exploration"][key] for key in ("t90_s", "t99_s")} == {7.0}


def test_what_only_unlabelled_keyframes_show_is_not_missed_in_the_maps_without_them():
    robot = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(odometry="truth"), seed=0)
    mapper = Mapper(robot.model, TruthClassifier(), localisation=OdometryLocalisation())
    score, figures = EpisodeScore(robot, Explorer(robot, mapper)), []
    for labelled in (True, False):
        score.on_keyframe(mapper.add_frame(mapper.localise(robot.sense()), labelled))
        figures.append(score.figures())
        for _ in range(round(1.0 / robot.control_period)):
            robot.drive(Velocity(0.0, 0.8))
    robot.close()
    before, after = figures
    assert before["exploration"]["explored_fraction"] < after["exploration"]["explored_fraction"]
    for stage in ("semantic_map", "segments"):
        assert before[stage] == after[stage]


def test_an_error_of_the_thread_that_scores_is_raised_where_the_score_is_read():
    robot = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(), seed=0)
    score = EpisodeScore(robot, Explorer(robot, Mapper(robot.model, TruthClassifier())))
    robot.sense()
    score.on_keyframe(None)
    for read in (lambda: score.coverage, lambda: score.progress, score.figures):
        with pytest.raises(AttributeError, match="NoneType"):
            read()
    robot.close()
