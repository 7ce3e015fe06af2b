import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.traversability import elevation_kernels as kernels
from pipeline.traversability.elevation_map import SurfaceMap
from pipeline.traversability.traversability import drivable_surface
from pipeline.traversability.traversability_layer import JUDGED, DrivableLayer
from tests.pipeline.worlds import flat, ground_points, ramp_and_deck, ridge, wall_points

pieces = st.tuples(
    st.sampled_from([flat, ridge, ramp_and_deck, None]),
    st.floats(-6, 6).map(lambda x: round(x, 2)),
    st.floats(-6, 6).map(lambda y: round(y, 2)),
    st.booleans(),
)


def look(surface, piece):
    """Show a piece of ground, or a wall, somewhere; perhaps with a stripe of it missing."""
    height, x, y, is_doubted = piece
    points = (
        wall_points((0, 0), (0.8, 0.3)) if height is None else ground_points(height, (-1.2, 1.2), (-0.8, 0.8))
    )
    points = points + np.array([x, y, 0], np.float32)
    missing = points[np.abs(points[:, 0] - x) < 0.03] if is_doubted else np.zeros((0, 3), np.float32)
    surface.update(points, missing, np.array([x - 2, y]))
    surface.add_track(np.array([[x, y - 0.1], [x + 0.3, y]]))


@settings(max_examples=25)
@given(st.lists(pieces, min_size=2, max_size=6))
def test_what_is_judged_look_by_look_is_what_is_judged_as_a_whole(looks):
    surface, layer = SurfaceMap(), DrivableLayer()
    look(surface, (flat, -6, -6, False))
    look(surface, (flat, 6, 6, False))
    layer.update(surface)
    for piece in looks:
        look(surface, piece)
        now, whole = layer.update(surface), drivable_surface(surface)
        for name in JUDGED:
            np.testing.assert_array_equal(getattr(now, name), getattr(whole, name), err_msg=name)
        np.testing.assert_array_equal(now.elevation, surface.elevation)


@settings(max_examples=25)
@given(st.lists(pieces, min_size=1, max_size=6))
def test_gaps_are_bridged_look_by_look_as_on_the_whole_map(looks):
    surface = SurfaceMap()
    for piece in looks:
        look(surface, piece)
    known = surface.measured
    np.testing.assert_array_equal(surface.elevation, kernels.bridge_gaps(known, surface.doubted, 3, 0.05))


def test_a_surface_that_was_given_out_stays_as_it_was():
    surface, layer = SurfaceMap(), DrivableLayer()
    look(surface, (flat, 0, 0, False))
    before = layer.update(surface)
    kept = before.drivable.copy(), before.elevation.copy()
    look(surface, (None, 0, 0, False))
    after = layer.update(surface)
    assert (after.drivable != before.drivable).any()
    np.testing.assert_array_equal(before.drivable, kept[0])
    np.testing.assert_array_equal(before.elevation, kept[1])


def test_nothing_new_is_judged_where_nothing_has_changed():
    surface, layer = SurfaceMap(), DrivableLayer()
    look(surface, (ridge, 0, 0, False))
    before = layer.update(surface)
    surface.update(np.zeros((0, 3), np.float32))
    assert layer.update(surface) is before
