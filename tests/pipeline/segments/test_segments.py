"""Segments that grow and merge, from hand-made patches and from frames."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.labels import Label
from pipeline.segments.boxes import corners
from pipeline.segments.config import SegmentsConfig
from pipeline.segments.planes import find_planes
from pipeline.segments.segments import Segments
from pipeline.transforms import from_yaw
from tests.pipeline.polygon_scene import floor, look, pose, wall, wedge
from tests.pipeline.segments.patches import deck, patch, segments_of, wall_patch


def test_wall_seen_piece_by_piece_is_one_segment() -> None:
    (segment,) = segments_of([wall_patch(0, 1)], [], [wall_patch(0.8, 2)], [wall_patch(2, 3)])
    assert segment.id == 0
    assert segment.members == (0, 1, 2)
    assert segment.label == Label.WALL
    assert segment.plane.normal == pytest.approx([0, -1, 0])
    assert segment.box.extent == pytest.approx([3, 1.2, 0], abs=1e-3)
    assert corners(segment.box).min(axis=0) == pytest.approx([0, 0, 0], abs=1e-3)
    assert corners(segment.box).max(axis=0) == pytest.approx([3, 0, 1.2], abs=1e-3)


def test_piece_between_joins_two_older_segments_under_the_older_id() -> None:
    apart = segments_of([wall_patch(0, 1), wall_patch(2, 3)])
    assert [s.id for s in apart] == [0, 1]
    (joined,) = segments_of([wall_patch(2, 3)], [wall_patch(0, 1)], [wall_patch(0.9, 2.1)])
    assert joined.id == 0
    assert joined.box.extent[0] == pytest.approx(3, abs=1e-3)


@pytest.mark.parametrize("gap", [0.4, 0.6, 1.2])
def test_door_keeps_two_walls_of_one_plane_apart(gap: float) -> None:
    left, right = segments_of([wall_patch(0, 1)], [wall_patch(1 + gap, 3)])
    assert left.box.extent[0] == pytest.approx(1, abs=1e-3)
    assert right.box.extent[0] == pytest.approx(2 - gap, abs=1e-3)


@pytest.mark.parametrize("thickness", [0.02, 0.04, 0.1])
def test_faces_of_a_panel_are_two_segments(thickness: float) -> None:
    front, back = segments_of([wall_patch(0, 2)], [wall_patch(0, 2, y=thickness, front=False)])
    assert front.plane.normal @ back.plane.normal == pytest.approx(-1)


def test_walls_at_a_corner_are_two_segments() -> None:
    for angle in (90, 45, 15):
        along = (np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle)), 0)
        turned = patch((2, 0, 0), along, (0, 0, 1), 2, 1.2)
        assert len(segments_of([wall_patch(0, 2), turned])) == 2


def test_parallel_surfaces_at_different_heights_are_two_segments() -> None:
    assert len(segments_of([deck(0, 1, 0, 1, 0.17), deck(1, 2, 0, 1, 0.27)])) == 2


def test_decks_that_touch_at_a_corner_are_two_segments() -> None:
    assert len(segments_of([deck(0, 1.2, 0, 1.2)], [deck(1.2, 2.4, 1.2, 2.4)])) == 2


def test_sliver_of_a_neighbour_does_not_join_it() -> None:
    """A corner of the other deck, seen alone, has more than half of its cells within reach of this deck."""
    sliver = deck(1.2, 1.33, 1.2, 1.37)
    assert len(segments_of([deck(0, 1.2, 0, 1.2)], [sliver], [deck(1.2, 2.4, 1.2, 2.4)])) == 2


def test_labels_are_kept_apart() -> None:
    assert len(segments_of([deck(0, 1, 0, 1), deck(1, 2, 0, 1, label=Label.TERRAIN)])) == 2


def test_segment_is_found_by_label() -> None:
    segments = Segments()
    segments.update([wall_patch(0, 1), deck(5, 6, 5, 6)], 7, np.eye(4))
    assert [s.label for s in segments] == [Label.WALL, Label.STRAIGHT_RAMP]
    assert segments.of(Label.STRAIGHT_RAMP, Label.TERRAIN) == list(segments)[1:]
    assert segments.of(Label.CEILING) == []


PIECES = [wall_patch(i, i + 1.2, z0=0.1 * i, z1=1.2) for i in range(5)]


@given(st.permutations(PIECES))
@settings(max_examples=30)
def test_order_of_the_pieces_does_not_matter(pieces) -> None:
    (expected,) = segments_of(PIECES)
    found = segments_of(*[[piece] for piece in pieces])
    assert len(found) == 1
    assert found[0].box.extent == pytest.approx(expected.box.extent, abs=1e-9)
    assert found[0].box.T_map_box == pytest.approx(expected.box.T_map_box, abs=1e-9)
    assert np.array_equal(found[0].cells, expected.cells)


@given(st.lists(st.tuples(st.floats(0, 2), st.floats(0.3, 1)), min_size=2, max_size=6))
@settings(max_examples=30)
def test_box_only_grows(pieces) -> None:
    segments = Segments()
    segments.update([wall_patch(0, 3, z1=0.3)], 0, np.eye(4))
    (segment,) = segments
    extent = segment.box.extent
    for step, (x, height) in enumerate(pieces, 1):
        segments.update([wall_patch(x, x + 0.5, z1=height)], step, np.eye(4))
        (segment,) = segments
        assert (segment.box.extent >= extent - 1e-9).all()
        extent = segment.box.extent


HEIGHT = 1.0
ROOM = [
    floor(0, 4, 0, 4),
    wall((4, 4), (4, 0), z1=HEIGHT),
    wall((0, 4), (4, 4), z1=HEIGHT),
    wall((0, 0), (0, 4), z1=HEIGHT),
    wall((4, 0), (0, 0), z1=HEIGHT),
    *wedge(1.5, 2, 0.6, 1.2, 0.17)[:3],
    floor(2.1, 3.3, 1.4, 2.6, z=0.17, label=Label.STRAIGHT_RAMP),
]
SLOPE = np.array([-0.17, 0, 0.6]) / np.hypot(0.17, 0.6)
SURFACES = [  # label, normal, middle, extent in the plane
    (Label.TERRAIN, (0, 0, 1), (2, 2, 0), (4, 4)),
    (Label.WALL, (-1, 0, 0), (4, 2, HEIGHT / 2), (4, HEIGHT)),
    (Label.WALL, (1, 0, 0), (0, 2, HEIGHT / 2), (4, HEIGHT)),
    (Label.WALL, (0, -1, 0), (2, 4, HEIGHT / 2), (4, HEIGHT)),
    (Label.WALL, (0, 1, 0), (2, 0, HEIGHT / 2), (4, HEIGHT)),
    (Label.STRAIGHT_RAMP, (0, 0, 1), (2.7, 2, 0.17), (1.2, 1.2)),
    (Label.INCLINED_RAMP, SLOPE, (1.8, 2, 0.085), (1.2, np.hypot(0.6, 0.17))),
    (Label.INCLINED_RAMP, (0, -1, 0), (1.8, 1.4, 0.085), (0.6, 0.17)),
    (Label.INCLINED_RAMP, (0, 1, 0), (1.8, 2.6, 0.085), (0.6, 0.17)),
]


def test_room_seen_from_its_corners_with_noise() -> None:
    """A floor, four walls, a ramp's slope and sides, a deck: one segment each, edges within 5 cm."""
    segments = Segments()
    for step, (corner, turn) in enumerate(product([(0.7, 0.7), (3.4, 0.8), (3.4, 3.3), (0.8, 3.3)], (-0.7, 0, 0.7))):
        T = pose(*corner, 0.6, np.arctan2(2 - corner[1], 2 - corner[0]) + turn, 0.25)
        frame = look(ROOM, T, sigma=0.01, seed=step)
        segments.update(find_planes(frame, frame.label[frame.returns], T, step, SegmentsConfig()), step, T)
    errors = []
    for label, normal, middle, extent in SURFACES:
        found = max(segments.of(label), key=lambda s: s.plane.normal @ np.array(normal))
        errors.append(np.rad2deg(np.arccos(min(found.plane.normal @ np.array(normal), 1))))
        off_middle = np.abs(found.box.T_map_box[:3, 3] - middle).max()
        assert off_middle + np.abs(found.box.extent[:2] - extent).max() / 2 <= 0.05
    assert len(segments) == len(SURFACES)
    assert np.median(errors) <= 0.5
    assert max(errors) <= 3


def shifts(*offsets: tuple[float, float, float]) -> np.ndarray:
    """(N, 4, 4) poses without rotation."""
    poses = np.tile(np.eye(4), (len(offsets), 1, 1))
    poses[:, :3, 3] = offsets
    return poses


def rebuilt(frames: list, *corrections: np.ndarray) -> Segments:
    """The segments of the patches of several frames, seen from the origin, after corrections of their poses."""
    segments = Segments()
    for keyframe, patches in enumerate(frames):
        segments.update(patches, keyframe, np.eye(4))
    for poses in corrections:
        segments.rebuild(poses)
    return segments


FRAMES = [[wall_patch(0, 1), deck(5, 6, 5, 6)], [wall_patch(0.8, 2), wall_patch(0, 2, y=3)], [deck(5.5, 7, 5, 6)]]


POSE = st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-0.1, 0.1), st.floats(-4, 4))


@given(st.lists(POSE, min_size=3, max_size=3), st.lists(POSE, min_size=3, max_size=3))
@settings(max_examples=30, deadline=None)
def test_rebuilt_segments_are_those_that_were_made_at_the_same_poses(poses, others) -> None:
    """Bit for bit, whatever the poses were in between."""
    segments, at = Segments(), np.array([from_yaw(*pose) for pose in poses])
    for keyframe, patches in enumerate(FRAMES):
        segments.update(patches, keyframe, at[keyframe])
    made = list(segments)
    segments.rebuild(np.array([from_yaw(*pose) for pose in others]))
    segments.rebuild(at)
    for old, new in zip(made, segments, strict=True):
        assert (old.id, old.label, old.members) == (new.id, new.label, new.members)
        np.testing.assert_array_equal(old.cells, new.cells)
        np.testing.assert_array_equal(old.box.T_map_box, new.box.T_map_box)
        np.testing.assert_array_equal(old.box.extent, new.box.extent)


def test_segments_move_with_their_keyframes() -> None:
    quarter = np.tile(np.array([(0, -1, 0, 2), (1, 0, 0, 1), (0, 0, 1, 0.5), (0, 0, 0, 1.0)]), (3, 1, 1))
    before, after = rebuilt(FRAMES), rebuilt(FRAMES, shifts((1, 0, 0), (2, 0, 0), (0, 5, 0)), quarter)
    for old, new in zip(before, after, strict=True):
        assert (old.id, old.label) == (new.id, new.label)
        np.testing.assert_allclose(new.plane.normal, quarter[0, :3, :3] @ old.plane.normal, atol=1e-6)
        expected = np.sort(corners(old.box) @ quarter[0, :3, :3].T + quarter[0, :3, 3], axis=0)
        np.testing.assert_allclose(np.sort(corners(new.box), axis=0), expected, atol=1e-3)


def test_walls_that_turn_out_to_be_one_are_joined_and_those_that_do_not_are_parted() -> None:
    doubled = [[wall_patch(0, 2)], [wall_patch(1, 3, y=0.3)]]
    assert len(rebuilt(doubled)) == 2
    (joined,) = rebuilt(doubled, shifts((0, 0, 0), (0, -0.3, 0)))
    assert joined.id == 0
    assert joined.box.extent == pytest.approx([3, 1.2, 0], abs=1e-2)
    parted = rebuilt(doubled, shifts((0, 0, 0), (0, -0.3, 0)), shifts((0, 0, 0), (0, 0, 0)))
    assert [s.id for s in parted] == [0, 1]
    assert [s.box.extent[0] for s in parted] == pytest.approx([2, 2], abs=1e-2)


def test_what_is_seen_after_a_correction_stays_where_it_was_seen() -> None:
    segments = rebuilt([[wall_patch(0, 2)]], shifts((0, 1, 0)))
    segments.update([wall_patch(1, 3, y=1)], 1, np.eye(4))
    assert len(segments) == 1
    segments.rebuild(shifts((0, 1, 0), (0, 0, 0)))
    (segment,) = segments
    assert segment.id == 0
    assert corners(segment.box).mean(axis=0) == pytest.approx([1.5, 1, 0.6], abs=1e-2)


@given(st.permutations(range(3)).flatmap(lambda order: st.tuples(st.just(order), POSE, POSE)))
@settings(max_examples=20, deadline=None)
def test_a_fold_that_begins_where_keyframes_moved_makes_what_a_whole_one_makes(drawn) -> None:
    order, *poses = drawn
    at, segments = np.tile(np.eye(4), (3, 1, 1)), Segments(config=SegmentsConfig(checkpoint_interval=2))
    for keyframe, patches in enumerate(FRAMES):
        segments.update(patches, keyframe, at[keyframe])
    for keyframe, moved in zip(order, poses, strict=False):
        at = at.copy()
        at[keyframe] = from_yaw(*moved)
        segments.rebuild(at)
        whole = Segments()
        whole.members = segments.members
        whole.rebuild(at)
        assert [s.members for s in segments] == [s.members for s in whole]
        for part, other in zip(segments, whole, strict=True):
            np.testing.assert_array_equal(part.box.T_map_box, other.box.T_map_box)
