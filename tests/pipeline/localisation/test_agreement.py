"""A robot that was carried sees what contradicts its map; a robot that drove does not."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.frame import Intrinsics
from pipeline.localisation.agreement import Agreement, agreement, agreement_with_previous
from pipeline.localisation.belief import Belief, MotionState
from pipeline.localisation.config import BeliefConfig
from pipeline.metric_map.metric_map import MetricMap
from pipeline.transforms import from_yaw
from tests.pipeline.localisation.carried_robot import ROOM, T_BASE_CAMERA, room, seen

CONFIG = BeliefConfig()
SURE = np.log(0.99 / 0.01)
HERE = from_yaw(1.0, 2.0, 0.0, 0.2)


def odds(found: Agreement, state: MotionState = MotionState.CARRIED) -> float:
    """Logarithm of how much likelier a state makes what was seen than a robot that is where it thinks does."""
    return float(np.subtract(*found.log_likelihoods(CONFIG)[[state, MotionState.NOMINAL]]))


@pytest.mark.parametrize("T_map_base", [HERE, from_yaw(3.0, 2.5, 0.0, -1.5), from_yaw(2.6, 1.0, 0.0, 0.4)])
def test_an_ordinary_error_of_the_pose_is_no_contradiction(T_map_base: np.ndarray) -> None:
    frame = seen(ROOM, T_map_base)
    for yaw in np.deg2rad([-2.0, 0.0, 2.0]):
        for towards in np.arange(8) * np.pi / 4:
            error = from_yaw(0.05 * np.cos(towards), 0.05 * np.sin(towards), 0.0, yaw)
            found = agreement(frame, T_map_base @ error @ T_BASE_CAMERA, room().metric_map)
            assert found.known > 100
            assert odds(found) < -SURE / 2


@pytest.mark.parametrize("T_map_base", [from_yaw(3, 0.6, 0, 0), from_yaw(4.2, 2.6, 0, -1.5), from_yaw(1, 3, 0, 2.2)])
def test_a_carried_robot_sees_what_the_map_denies(T_map_base: np.ndarray) -> None:
    found = agreement(seen(ROOM, T_map_base), HERE @ T_BASE_CAMERA, room().metric_map)
    assert odds(found) == pytest.approx(SURE)
    assert found.short + found.through == found.known - found.explained > 0


def test_what_the_map_does_not_know_counts_neither_way() -> None:
    found = agreement(seen(ROOM, HERE), HERE @ T_BASE_CAMERA, MetricMap())
    assert (found.known, found.explained_fraction, odds(found)) == (0, 1.0, 0.0)
    assert found.seen > 100


def test_specks_of_dust_are_no_contradiction() -> None:
    frame, rng = seen(ROOM, HERE), np.random.default_rng(0)
    specks = rng.random(frame.depth.shape) < 0.1
    dusty = replace(
        frame, depth=np.where(specks, rng.uniform(0.8, 1.5, specks.shape), frame.depth).astype(np.float32)
    )
    assert odds(agreement(dusty, HERE @ T_BASE_CAMERA, room().metric_map)) < -SURE / 2


def test_what_ought_to_be_seen_and_is_not_leaves_doubt() -> None:
    frame = seen(ROOM, HERE)
    blind = replace(frame, depth=np.zeros_like(frame.depth))
    there, nothing = (agreement(f, HERE @ T_BASE_CAMERA, room().metric_map) for f in (frame, blind))
    assert there.known > 0.9 * there.expected > 100
    assert (nothing.known, nothing.expected) == (0, there.expected)
    assert odds(nothing, MotionState.BLIND) == pytest.approx(SURE)
    assert odds(there, MotionState.BLIND) == pytest.approx(-SURE)
    assert nothing.expects_enough
    assert not agreement(blind, HERE @ T_BASE_CAMERA, MetricMap()).expects_enough


@pytest.mark.parametrize("to", [from_yaw(3, 0.6, 0, 0), from_yaw(4.2, 2.6, 0, -1.5), from_yaw(0.3, 2.0, 0.0, np.pi)])
def test_a_robot_whose_view_changed_while_its_wheels_stood_was_carried(to: np.ndarray) -> None:
    before = seen(ROOM, HERE)
    carried = replace(seen(ROOM, to, seed=1), T_odom_base=before.T_odom_base)
    changed = agreement_with_previous(carried, before)
    assert changed is not None
    assert max(odds(changed), odds(changed, MotionState.BLIND)) == pytest.approx(SURE)
    assert agreement_with_previous(seen(ROOM, to, seed=1), before) is None, "by its wheels it drove there"


def test_noise_and_a_small_move_show_the_same_place() -> None:
    before = seen(ROOM, HERE)
    for move in (from_yaw(0, 0, 0, 0), from_yaw(0.015, -0.01, 0, 0.03)):
        changed = agreement_with_previous(seen(ROOM, HERE @ move, seed=2), before)
        assert changed is not None
        assert odds(changed) < -SURE / 2


@pytest.mark.parametrize(("width", "height"), [(512, 424), (640, 576), (672, 376)])
def test_a_camera_of_any_size_is_compared_tile_by_tile(width: int, height: int) -> None:
    camera = Intrinsics(width, height, 400.0, 400.0, width / 2, height / 2)
    depth = np.full((height, width), 2.0, np.float32)
    frame = replace(seen(ROOM, HERE), rgb=np.zeros((height, width, 3), np.uint8), depth=depth, intrinsics=camera)
    side = width // 32
    assert agreement(frame, HERE @ T_BASE_CAMERA, room().metric_map).seen == (height // side - 2) * (
        width // side - 2
    )


def test_a_view_that_changed_while_the_wheels_stood_outweighs_a_place_that_looks_alike() -> None:
    """Both were measured after a robot was carried in nist_6x4, 10 s ago."""
    by_map, by_last = Agreement(479, 33, 0, 660, 446), Agreement(253, 123, 94, 768, 470)
    for parts, knows in ([by_map], True), ([by_map, by_last], False):
        belief = Belief()
        belief.predict(distance=0.0, seconds=10.0)
        belief.observe(Agreement.of(parts).log_likelihoods(CONFIG))
        assert belief.knows_place == knows
    assert by_last.shows_another_place(CONFIG)
    assert not by_map.shows_another_place(CONFIG)
