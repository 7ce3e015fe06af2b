"""Maps follow the poses of their keyframes."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from pipeline.config import PipelineConfig
from pipeline.elevation_map.pose_kernels import HEADING_ANGLES
from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.keyframes import Moves
from pipeline.labels import Label
from pipeline.localisation.localisation import LocalisedFrame, LostError
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.localisation.trajectory import EstimatedTrajectory
from pipeline.mapper import Mapper
from pipeline.metric_map.config import MetricMapConfig
from pipeline.planning.pose_paths import heading_mask
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.sink import Sink
from pipeline.tracks.find import Reading, box_corners
from pipeline.transforms import from_yaw, yaw_of
from tests.pipeline.polygon_scene import HALF, RANGE, floor, look, pose, wall, wedge
from tests.pipeline.robot_model import PIONEER

SCENE = [
    floor(-2, 6, -3, 3),
    wall((5.21, 2.31), (5.21, -2.29)),
    wall((1.01, 2.31), (5.21, 2.31)),
    wall((4.5, -2.29), (1.03, -2.29)),
    *wedge(3.13, 0.03, 1.1, 1.2, 0.3),
]
T_BASE_CAMERA = pose(0.1, 0, 0.65, 0, 0.3)
POSES = np.array([from_yaw(0.02 + 0.4 * k, 0.32 * (-1) ** k, 0, 0.5 * (k % 3 - 1)) for k in range(6)])
LABELLED = [True, False, True, False, False, True]
FRAMES = [
    replace(look(SCENE, T @ T_BASE_CAMERA, 0.004, seed, camera=HALF), T_base_camera=T_BASE_CAMERA, T_odom_base=T)
    for seed, T in enumerate(POSES)
]


def mapped(poses: np.ndarray) -> Mapper:
    """A mapper whose robot was set down at the first of these poses, with a drive up to the third."""
    mapper = Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation())
    for k, (frame, T, labelled) in enumerate(zip(FRAMES, poses, LABELLED, strict=True)):
        mapper.add_frame(LocalisedFrame(frame, T), labelled, set_down=k == 0)
        if k == 2:
            track, box = np.array([(-0.05, 0.02, 0), (0, 0, 0), (0.03, 0.01, 0)]), np.full((60, 3), (0.4, 0, 0.35))
            track, box, panel = (p @ T[:3, :3].T + T[:3, 3] for p in (track, box, np.array([(0.3, 0.2, 0.3)])))
            poses = np.column_stack([track[:, :2], np.full(len(track), yaw_of(T))])
            mapper.add_drive(poses, box.astype(np.float32), [panel])
    return mapper


TRUE = mapped(POSES)


def test_drives_near_people_are_planned_with_their_speed_limit(monkeypatch):
    person = np.array([[2.0, 0.0, 0.1]], np.float32)
    monkeypatch.setattr(Mapper, "people", [person])
    ground, limit = TRUE.drivable, TRUE.config.navigation.speed_limit
    assert ground.costs().speed_near_people == limit.speed_near_people
    near = ground.grid.distance_to(ground.grid.mask_of(person)) <= limit.beside_people
    np.testing.assert_array_equal(ground.terrain.beside_people, near)


FLOOR = floor(-2, 6, -3, 3)
DECK = [floor(-2, 0.4, -1, 6), floor(0.4, 6, -3, 6, z=-0.3)]


def set_down(faces: list, *yaws: float, reach: tuple[float, float] = RANGE) -> Mapper:
    """A mapper whose robot was set down at the origin, where it turns to these headings."""
    mapper = Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation())
    for seed, yaw in enumerate(yaws):
        T = from_yaw(0, 0, 0, yaw)
        frame = look(faces, T @ T_BASE_CAMERA, 0.004, seed, reach, HALF)
        mapper.add_frame(LocalisedFrame(replace(frame, T_base_camera=T_BASE_CAMERA), T), False, set_down=seed == 0)
    return mapper


@pytest.mark.parametrize(
    ("faces", "is_level"), [([FLOOR], True), (DECK, False), ([FLOOR, wall((0.7, 1.5), (0.7, -1.5))], False)]
)
def test_ground_before_a_robot_that_was_set_down_is_level_only_if_level_ground_is_in_view(faces, is_level):
    elevation_map = set_down(faces, 0.0).elevation_map
    around, before = elevation_map.grid.at(elevation_map.elevation, [(-0.4, 0.0), (0.75, 0.0)], np.nan)
    assert abs(around) < 0.01
    assert np.isfinite(before) == is_level


def test_a_post_nearer_than_the_camera_sees_does_not_stand_on_ground_that_is_taken_for_level():
    elevation_map = set_down([FLOOR, wall((0.65, -0.2), (0.65, -0.05))], 0.0, reach=(0.8, 4.0)).elevation_map
    at_post, beside = elevation_map.grid.at(elevation_map.elevation, [(0.65, -0.125), (0.65, 0.125)], np.nan)
    assert np.isnan(at_post)
    assert abs(beside) < 0.01


def test_a_robot_that_turns_where_it_was_set_down_finds_the_way_from_a_deck():
    elevation_map = set_down(DECK, 0.0, np.pi / 2).elevation_map
    off, along = elevation_map.grid.at(elevation_map.elevation, [(0.75, 0.0), (0.0, 0.75)], np.nan)
    assert np.isnan(off)
    assert abs(along) < 0.01


def test_a_robot_set_down_between_walls_that_it_cannot_see_turns_there_and_stays_off_them():
    """Its camera sees nothing nearer than 0.8 m; the walls are 0.5 m away on all sides."""
    corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5)]
    cell = [FLOOR, *(wall(a, b) for a, b in pairwise(corners))]
    mapper = set_down(cell, *np.arange(8) * np.pi / 4, reach=(0.8, 4.0))
    ground = mapper.traversability
    assert ground.grid.at(ground.turnable, (0.0, 0.0))
    cells, headings = np.split(np.argwhere(heading_mask(ground.free[..., 0].astype(np.uint16))), [2], axis=1)
    angles = HEADING_ANGLES[headings[:, 0]]
    reach = PIONEER.half_length * np.abs([np.cos(angles), np.sin(angles)])
    reach += PIONEER.half_width * np.abs([np.sin(angles), np.cos(angles)])
    assert (np.abs(ground.grid.centre_of(cells)) + reach.T).max() < 0.5


def ground_at(height: float) -> Mapper:
    """A mapper of a robot that was set down at a height, m."""
    mapper = Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation())
    mapper.add_frame(LocalisedFrame(FRAMES[0], from_yaw(0, 0, height, 0)), set_down=True)
    return mapper


@pytest.mark.parametrize("height", [-0.7, 2.2, 30.02, -1000.0])
def test_heights_count_from_where_the_robot_was_set_down(height):
    level, raised = ground_at(0.0), ground_at(height)
    seen = [np.isfinite(mapper.elevation_map.measured) for mapper in (level, raised)]
    assert seen[0].sum() > 100
    assert abs(int(seen[1].sum()) - int(seen[0].sum())) <= 0.02 * seen[0].sum()
    medians = [np.nanmedian(mapper.elevation_map.elevation) for mapper in (level, raised)]
    assert medians[1] - medians[0] == pytest.approx(height, abs=0.01)


@pytest.mark.parametrize("height", [0.0, 30.02])
def test_classifiers_get_heights_over_where_the_robot_was_set_down(height):
    class Heights(TruthClassifier):
        def classify(self, frame, points, T_map_camera):
            self.seen = np.median(points[:, 2]), T_map_camera[2, 3]
            return super().classify(frame, points, T_map_camera)

    plain, lifted = Heights(), Heights()
    for classifier, z in ((plain, 0.0), (lifted, height)):
        mapper = Mapper(PIONEER, classifier, localisation=OdometryLocalisation())
        mapper.add_frame(LocalisedFrame(FRAMES[0], from_yaw(0, 0, z, 0)), set_down=True)
    np.testing.assert_allclose(lifted.seen, plain.seen, atol=0.03)


def test_what_is_farther_than_kept_points_reach_is_no_return():
    far = look([wall((12, 9), (12, -9), -3, 9)], T_BASE_CAMERA, reach=(0.5, 20))
    mapper = Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation())
    mapper.add_frame(LocalisedFrame(replace(far, T_base_camera=T_BASE_CAMERA), np.eye(4)))
    assert not len(mapper.semantic_map.points())
    assert np.isnan(mapper.elevation_map.measured).all()
    assert len(mapper.metric_map.free_centres())


def assert_same(one: Mapper, other: Mapper) -> None:
    for voxels in ("occupied_centres", "free_centres"):
        np.testing.assert_array_equal(getattr(one.metric_map, voxels)(), getattr(other.metric_map, voxels)(), voxels)
    centres = one.metric_map.occupied_centres()
    values = [m.metric_map.log_odds_at(m.metric_map.voxel_index(centres)) for m in (one, other)]
    np.testing.assert_array_equal(*values)
    for values in ("points", "labels", "probabilities", "hits"):
        a, b = (getattr(m.semantic_map, values)() for m in (one, other))
        np.testing.assert_array_equal(a, b, values)
    assert_same_ground(one, other)


def assert_same_segments(one: Mapper, other: Mapper) -> None:
    for old, new in zip(one.segments, other.segments, strict=True):
        assert (old.id, old.label, old.members) == (new.id, new.label, new.members)
        np.testing.assert_array_equal(old.cells, new.cells)


def from_scratch(mapper: Mapper) -> Mapper:
    """Another mapper with the same evidence at the same poses, which makes every map of it."""
    other, known = Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation()), mapper.keyframes
    for seen, T in zip(known.observations, known.poses, strict=True):
        other.keyframes.add(seen, T)
    for k, evidence in known.ground_evidence:
        other.keyframes.add_ground(k, evidence)
    other.segments.members = mapper.segments.members
    other.restore()
    return other


def assert_same_ground(one: Mapper, other: Mapper) -> None:
    """Both have the same ground on the cells of ``one``, and the other has none beyond them."""
    grid = one.elevation_map.grid
    other.elevation_map.layers.match(grid)
    box = other.elevation_map.grid.box_of(grid)
    for layer in ("measured", "elevation", "dropout", "driven"):
        a, b = getattr(one.elevation_map, layer), getattr(other.elevation_map, layer)
        np.testing.assert_array_equal(a, b[box], layer)
        assert np.count_nonzero(np.nan_to_num(b)) == np.count_nonzero(np.nan_to_num(a))
    a, b = (m.traversability.traversable for m in (one, other))
    np.testing.assert_array_equal(a, b[box])


def test_the_scene_has_something_in_every_map():
    assert len(TRUE.metric_map.occupied_centres()) > 500
    assert len(np.unique(TRUE.semantic_map.labels())) == 3
    assert TRUE.elevation_map.grid.at(TRUE.elevation_map.driven, POSES[:, :3, 3]).all()
    assert np.count_nonzero(TRUE.elevation_map.driven) == 7  # those of six keyframes and one more of the track
    assert len(TRUE.segments) >= 5
    assert TRUE.traversability.traversable.sum() > 500


def test_correcting_to_the_same_poses_changes_nothing():
    mapper = mapped(POSES)
    mapper.correct(POSES)
    assert_same(TRUE, mapper)
    assert_same_segments(TRUE, mapper)
    assert_same(from_scratch(mapper), mapper)


@settings(max_examples=4, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(st.lists(st.tuples(*[st.floats(-0.1, 0.1)] * 3), min_size=6, max_size=6), st.floats(-0.2, 0.5))
def test_wrong_poses_leave_no_trace_once_they_are_corrected(errors, drift):
    astray = [T @ from_yaw(x, y, 0, yaw) for T, (x, y, yaw) in zip(POSES, errors, strict=True)]
    mapper = mapped(np.array([from_yaw(drift * k, 0, 0, 0) @ T for k, T in enumerate(astray)]))
    mapper.correct(POSES)
    assert not Moves.between(mapper.keyframes.poses, POSES, RANGE[1], 0.01).are_noticeable.any()
    assert_same(mapped(mapper.keyframes.poses), mapper)


@settings(max_examples=4, deadline=None, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(st.sets(st.integers(0, 5), min_size=1, max_size=2), st.floats(0.02, 0.3), st.floats(-0.2, 0.2))
def test_if_some_keyframes_move_the_maps_are_those_made_at_their_new_poses_from_the_start(moving, x, yaw):
    poses = POSES.copy()
    for k in moving:
        poses[k] = poses[k] @ from_yaw(x, 0, 0, yaw)
    mapper = mapped(POSES)
    mapper.correct(poses)
    np.testing.assert_array_equal(mapper.keyframes.poses, poses)
    assert_same(mapped(poses), mapper)
    assert_same_segments(from_scratch(mapper), mapper)


def test_keyframes_that_move_unnoticeably_stay():
    mapper = mapped(POSES)
    moves = mapper.correct(POSES @ from_yaw(0.004, 0, 0, 0.001))
    assert not moves.distances.any()
    np.testing.assert_array_equal(mapper.keyframes.poses, POSES)
    assert_same(TRUE, mapper)


def test_while_the_robot_drives_the_maps_wait_for_moves_that_are_due():
    mapper, config = mapped(POSES), PipelineConfig().keyframes
    localisation, moved = mapper.localisation, POSES.copy()
    moved[:, 0, 3] += (config.min_displacement + config.correction_threshold) / 2
    localisation.restore(replace(localisation.keyframes(), poses=moved))
    assert mapper.apply_corrections(only_if_due=True) is None
    np.testing.assert_array_equal(mapper.keyframes.poses, POSES)
    assert mapper.apply_corrections().are_noticeable.all()
    np.testing.assert_array_equal(mapper.keyframes.poses, moved)
    moved[0, 0, 3] += 1.5 * config.correction_threshold
    assert mapper.apply_corrections(only_if_due=True).are_noticeable.tolist() == [True] + 5 * [False]


def test_maps_move_as_one_with_all_keyframes():
    mapper, shift = mapped(POSES), np.array([3.0, -2.0, 0.0])  # whole cells and voxels of every map
    moved = POSES.copy()
    moved[:, :3, 3] += shift
    mapper.correct(moved)
    centres = TRUE.metric_map.occupied_centres()
    assert len(mapper.metric_map.occupied_centres()) == pytest.approx(len(centres), rel=2e-3)
    assert (mapper.metric_map.p_free_at(centres + shift) == 0).mean() > 0.998
    assert len(mapper.semantic_map) == pytest.approx(len(TRUE.semantic_map), rel=2e-3)
    grid, known = TRUE.elevation_map.grid, ~np.isnan(TRUE.elevation_map.elevation)
    there = mapper.elevation_map.grid.at(
        mapper.elevation_map.elevation, grid.centre_of(np.argwhere(known)) + shift[:2], np.nan
    )
    assert (np.abs(there - TRUE.elevation_map.elevation[known]) < 1e-3).mean() > 0.998
    assert np.count_nonzero(~np.isnan(mapper.elevation_map.elevation)) == pytest.approx(known.sum(), rel=2e-3)
    np.testing.assert_array_equal(mapper.T_map_start, moved[0])


def test_a_keyframe_that_is_not_labelled_is_in_the_geometric_maps_alone():
    mapper = Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation())
    keyframe = mapper.add_frame(LocalisedFrame(FRAMES[0], POSES[0]), labelled=False)
    assert not any(map(len, (mapper.semantic_map, mapper.segments, keyframe.points, keyframe.labels)))
    assert len(mapper.metric_map.occupied_centres()) > 0
    assert np.isfinite(mapper.elevation_map.measured).any()
    assert (keyframe.index, len(mapper.keyframes)) == (0, 1)


def test_little_is_kept_of_a_keyframe():
    mapper = Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation())
    frame = replace(look(SCENE, T_BASE_CAMERA, 0.004), T_base_camera=T_BASE_CAMERA)
    for labelled, most in ((True, 400_000), (False, 200_000)):
        mapper.add_frame(LocalisedFrame(frame, np.eye(4)), labelled)
        assert mapper.keyframes.observations[-1].nbytes < most


def test_poses_that_are_none_are_refused():
    mapper = mapped(POSES)
    for bad in (POSES[:5], np.zeros_like(POSES), POSES * np.nan, POSES[0]):
        with pytest.raises(InputError, match="6 keyframes"):
            mapper.correct(bad)
    assert_same(TRUE, mapper)


@pytest.mark.parametrize("reach", [1e3, 1e6, np.nan])
def test_a_frame_from_far_away_leaves_the_maps_as_they_are(reach):
    mapper = Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation())
    for frame, T in zip(FRAMES[:2], POSES, strict=False):
        mapper.add_frame(LocalisedFrame(frame, T))
    far = POSES[2].copy()
    far[0, 3] = far[1, 3] = reach
    with pytest.raises((InputError, LostError), match=r"odometry|would take"):
        mapper.add_frame(mapper.localise(replace(FRAMES[2], T_odom_base=far)))
    assert len(mapper.keyframes) == len(mapper.localisation.poses) == 2
    assert mapper.apply_corrections() is None


class Broken(TruthClassifier):
    """A classifier, detector and reader, one of which gives an invalid result for every frame after the first."""

    def __init__(self, part: str):
        self.part, self.seen = part, 0

    def _fails(self, part: str) -> bool:
        self.seen += part == self.part
        return part == self.part and self.seen > 1

    def classify(self, frame, points, T_map_camera):
        return super().classify(frame, points, T_map_camera) * (np.nan if self._fails("classifier") else 1)

    def detect(self, rgb):
        return None if self._fails("detector") else []

    def read(self, frame, detections):
        return [Reading("No Kind", "", np.zeros((4, 2)), 0.9)] if self._fails("reader") else []


def refused(mapper: Mapper, labelled: bool) -> int:
    """The number of keyframes when a mapper has refused the second or third frame."""
    trajectory = EstimatedTrajectory(mapper.localisation, FRAMES)

    class Watch(Sink):
        def on_keyframe(self, keyframe):
            trajectory.add(keyframe.frame)

    mapper.observers.append(Watch())
    mapper.add_frame(LocalisedFrame(FRAMES[0], POSES[0]), set_down=True)
    with pytest.raises(InputError):
        for k in (1, 2):
            mapper.add_frame(LocalisedFrame(FRAMES[k], from_yaw(30.0, 0, 0, 0) @ POSES[k]), labelled)
    assert mapper.apply_corrections() is None
    mapper.correct(mapper.localisation.poses @ from_yaw(0.1, 0, 0, 0))
    assert len(trajectory.estimated()) == len(FRAMES)
    return len(mapper.keyframes)


@pytest.mark.parametrize(
    ("part", "labelled", "keyframes"),
    [("classifier", True, 1), *((part, how, 2) for part in ("detector", "reader") for how in (True, False))],
)
def test_an_invalid_result_leaves_the_keyframes_and_poses_whole(part, labelled, keyframes):
    broken = Broken(part)
    mapper = Mapper(PIONEER, broken, broken, localisation=OdometryLocalisation(), readers=broken)
    assert refused(mapper, labelled) == keyframes


@pytest.mark.parametrize("labelled", [True, False])
def test_a_full_metric_map_leaves_the_keyframes_and_poses_whole(labelled):
    full = MetricMapConfig(max_bytes=TRUE.metric_map.nbytes)
    config = PipelineConfig(metric_map=full)
    mapper = Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation(), config=config)
    assert refused(mapper, labelled) == 1


def test_a_full_elevation_map_leaves_the_keyframes_and_poses_whole(monkeypatch):
    mapper = Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation())
    update, calls = mapper.elevation_map.update, []

    def refuse(points, *args):
        calls.append(points)
        if len(calls) == 2:
            raise InputError("the elevation map is full")
        update(points, *args)

    monkeypatch.setattr(mapper.elevation_map, "update", refuse)
    with pytest.raises(InputError):
        for frame, T in zip(FRAMES[:2], POSES, strict=False):
            mapper.add_frame(LocalisedFrame(frame, T))
    assert len(mapper.keyframes) == len(mapper.localisation.poses) == 1


def test_a_drive_to_far_away_is_not_kept():
    mapper = mapped(POSES)
    with pytest.raises(InputError, match="would take"):
        mapper.add_drive(np.array([(0, 0, 0), (1e5, 1e5, 0)]), np.zeros((0, 3), np.float32), [])
    moves = mapper.correct(POSES @ from_yaw(0.2, 0, 0, 0))
    assert moves.are_noticeable.all()


class ReadersOfOneSign:
    """See a sign in the middle of every image, and note which frames they were asked for."""

    def __init__(self):
        self.asked = []

    def read(self, frame, detections):
        self.asked.append(frame)
        u, v = frame.intrinsics.cx, frame.intrinsics.cy
        return [Reading("hazmat_sign", "poison", box_corners((u - 9, v - 9, u + 9, v + 9)), 0.9)]


def test_what_keyframes_on_the_way_show_is_on_the_map_from_the_next_one_on():
    readers = ReadersOfOneSign()
    mapper = Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation(), readers=readers)
    shown = []
    for frame, T in zip(FRAMES[:4], POSES[:4], strict=True):
        mapper.add_frame(LocalisedFrame(frame, T), labelled=frame is FRAMES[3], set_down=frame is FRAMES[0])
        shown.append(sorted(sighting.keyframe for track in mapper.finds.all for sighting in track.seen))
    assert shown == [[], [0], [0, 1], [0, 1, 2, 3]]
    assert readers.asked == FRAMES[:4]
    mapper.add_frame(LocalisedFrame(FRAMES[4], POSES[4]), labelled=False)
    mapper.apply_corrections()  # the last keyframe of a run that is cut off counts too
    assert sorted(sighting.keyframe for track in mapper.finds.all for sighting in track.seen) == [0, 1, 2, 3, 4]


class Ramps:
    """Takes everything for a ramp; as a classifier of one's own, it need not say whether it is certain."""

    def classify(self, frame: Frame, points: np.ndarray, T_map_camera: np.ndarray) -> np.ndarray:
        return np.eye(len(Label), dtype=np.float32)[np.full(len(points), Label.INCLINED_RAMP)]


class CertainRamps(Ramps):
    is_certain = True


@pytest.mark.parametrize(("classifier", "is_revised"), [(Ramps(), True), (CertainRamps(), False)])
def test_the_map_revises_labels_that_are_not_certain(classifier: Ramps, is_revised: bool) -> None:
    mapper = Mapper(PIONEER, classifier, localisation=OdometryLocalisation())
    mapper.add_frame(LocalisedFrame(FRAMES[0], POSES[0]))
    mapper.revise_labels()
    assert (mapper.semantic_map.labels() != Label.INCLINED_RAMP).any() == is_revised
