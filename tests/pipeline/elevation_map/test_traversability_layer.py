import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.elevation_map import elevation_kernels as kernels
from pipeline.elevation_map.config import ElevationConfig, TraversabilityConfig
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.traversability import LAYERS, TraversabilityLayer, assess_map
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.worlds import flat, ground_points, ramp_and_deck, ridge, show, wall_points

pieces = st.tuples(
    st.sampled_from([flat, ridge, ramp_and_deck, None]),
    st.floats(-6, 6).map(lambda x: round(x, 2)),
    st.floats(-6, 6).map(lambda y: round(y, 2)),
    st.booleans(),
)


def step(elevation_map, piece):
    """Show a piece of ground or of a wall to the map, perhaps with a stripe of dropouts."""
    height, x, y, drops_out = piece
    points = wall_points((0, 0), (0.8, 0.3)) if height is None else ground_points(height, (-1.2, 1.2), (-0.8, 0.8))
    points = points + np.array([x, y, 0], np.float32)
    missing = points[np.abs(points[:, 0] - x) < 0.03] if drops_out else np.zeros((0, 3), np.float32)
    show(elevation_map, points, missing, camera=np.array([x - 2, y, 0.6]))
    elevation_map.add_track(np.array([[x, y - 0.1, 0.0], [x + 0.3, y, 0.5]]))


@settings(max_examples=15)
@given(st.lists(pieces, min_size=2, max_size=5))
def test_what_is_judged_keyframe_by_keyframe_is_what_is_judged_as_a_whole(steps):
    elevation_map, layer = ElevationMap(PIONEER), TraversabilityLayer()
    for piece in steps:  # the map grows now and then
        step(elevation_map, piece)
        now, whole = layer.update(elevation_map), assess_map(elevation_map)
        for name in LAYERS:
            np.testing.assert_array_equal(getattr(now, name), getattr(whole, name), err_msg=name)
        np.testing.assert_array_equal(now.elevation, elevation_map.elevation)


def test_a_ramp_is_judged_as_on_the_whole_map_as_far_as_its_margin_reaches():
    config = ElevationConfig(traversability=TraversabilityConfig(ramp_margin=2.0))
    elevation_map, layer = ElevationMap(PIONEER, config), TraversabilityLayer()
    for x in ((-3, -0.1), (-0.1, 1.5)):
        elevation_map.update(ground_points(ramp_and_deck, x, (-1, 1)))
        now = layer.update(elevation_map)
    whole = assess_map(elevation_map)
    for name in LAYERS:
        np.testing.assert_array_equal(getattr(now, name), getattr(whole, name), err_msg=name)


@settings(max_examples=25)
@given(st.lists(pieces, min_size=1, max_size=6))
def test_gaps_are_bridged_keyframe_by_keyframe_as_on_the_whole_map(steps):
    elevation_map = ElevationMap(PIONEER)
    for piece in steps:
        step(elevation_map, piece)
    ceiling, dropout = elevation_map.layers["ceiling"], elevation_map.dropout
    bridged = kernels.bridge_gaps(elevation_map.measured, dropout, ceiling, 3, 0.05, 0.3)
    filled = kernels.fill_pockets(bridged, dropout, 3, 0.05)
    np.testing.assert_array_equal(elevation_map.elevation, filled)


def test_what_was_given_out_stays_as_it_was():
    elevation_map, layer = ElevationMap(PIONEER), TraversabilityLayer()
    step(elevation_map, (flat, 0, 0, False))
    before = layer.update(elevation_map)
    kept = before.traversable.copy(), before.elevation.copy()
    step(elevation_map, (None, 0, 0, False))
    after = layer.update(elevation_map)
    assert (after.traversable != before.traversable).any()
    np.testing.assert_array_equal(before.traversable, kept[0])
    np.testing.assert_array_equal(before.elevation, kept[1])


def test_nothing_new_is_judged_where_nothing_has_changed():
    elevation_map, layer = ElevationMap(PIONEER), TraversabilityLayer()
    step(elevation_map, (ridge, 0, 0, False))
    before = layer.update(elevation_map)
    elevation_map.update(np.zeros((0, 3), np.float32))
    assert layer.update(elevation_map) is before
