"""A mapper goes on from what an earlier one left."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.frame import Frame, Intrinsics
from pipeline.keyframes import AnchoredPlaces
from pipeline.labels import Label
from pipeline.localisation.localisation import LocalisedFrame
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.localisation.slam import Slam
from pipeline.map_file import LAYOUT, VERSION, load_elevation_map, load_keyframes, save_keyframes, varies
from pipeline.mapper import Mapper
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.tracks.find import Reading, box_corners
from pipeline.tracks.objects import best_returns
from pipeline.tracks.track import Observation, Track
from pipeline.transforms import from_yaw
from pipeline.victims.people import PeoplePolicy
from tests.pipeline.polygon_scene import HALF, floor, look, pose, wall, wedge
from tests.pipeline.robot_model import PIONEER

SCENE = [floor(-2, 6, -3, 3), wall((3.2, 2.3), (3.2, -2.3)), *wedge(2.0, 0.3, 0.8, 1.0, 0.2)]
T_BASE_CAMERA = pose(0.1, 0, 0.65, 0, 0.3)
POSES = [from_yaw(0.3 * k, 0.02, 0, 0.2 * (k % 2)) for k in range(4)]


def seen_from(T_map_base: np.ndarray, T_odom_base: np.ndarray, seed: int = 0, camera: Intrinsics = HALF) -> Frame:
    frame = look(SCENE, T_map_base @ T_BASE_CAMERA, 0.004, seed, camera=camera)
    return replace(frame, T_base_camera=T_BASE_CAMERA, T_odom_base=T_odom_base)


def new_mapper() -> Mapper:
    return Mapper(PIONEER, TruthClassifier(), localisation=Slam())


@pytest.fixture(scope="module")
def mapper() -> Mapper:
    """One that has met a person and driven into something, and whose poses were corrected."""
    mapper = new_mapper()
    for k, T in enumerate(POSES):
        mapper.add_frame(mapper.localise(seen_from(T, T, seed=k)), labelled=k % 2 == 0, set_down=k == 0)
    mapper.add_drive(np.array([(0.1, 0.0, 0.2)]), np.full((9, 3), 0.5, np.float32), [np.array([(0.3, 0.2, 0.3)])])
    points = np.random.default_rng(0).uniform(1, 1.5, (50, 3)).astype(np.float32)
    poses = mapper.keyframes.poses
    photo = np.arange(60, dtype=np.uint8).reshape(4, 5, 3)
    seen = [
        Observation(
            Reading("victim", "", box_corners((1, 2, 3, 4)), sure),
            k,
            points[0],
            100 * np.eye(3),
            np.full(3, 0.5 * k),
            points[k:] + np.float32(0.01 * k),
            photo[: 4 * k],
            walls=np.array([[-1.0, 0, 0, -2 - k]])[: k // 2],
        )
        for k, sure in ((0, 0.7), (2, 0.8))
    ]
    tried = [AnchoredPlaces.anchored(np.ones((1, 3)), poses)]
    mapper.victims.all = [Track(PeoplePolicy(), seen, list(seen), missed={1, 3}, tried=tried)]
    reading = Reading("qr_code", "Ausgang \N{RIGHTWARDS ARROW}", box_corners((1, 2, 3, 4)), 0.9)
    code = Observation(reading, 2, np.ones(3), 9 * np.eye(3), np.zeros(3), points[:7], photo, 1.0)
    mapper.finds.all = [Track(mapper.finds.policy_of("qr_code"), [code], [code], missed={3}, tried=list(tried))]
    mapper.correct(poses @ from_yaw(0.02, 0, 0, 0.01))
    mapper.localisation.graph.poses = mapper.keyframes.poses
    mapper.localisation.local_map.apply_poses(mapper.keyframes.poses)
    return mapper


@pytest.fixture(scope="module")
def file(mapper, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("map") / "keyframes.npz"
    save_keyframes(mapper, path)
    return path


def test_a_loaded_map_is_the_one_that_was_saved(mapper, file):
    loaded = new_mapper()
    load_keyframes(file, loaded)
    np.testing.assert_array_equal(loaded.keyframes.poses, mapper.keyframes.poses)
    lower, upper = mapper.metric_map.bounds()
    np.testing.assert_array_equal(loaded.metric_map.log_odds(lower, upper), mapper.metric_map.log_odds(lower, upper))
    np.testing.assert_array_equal(loaded.semantic_map.points(), mapper.semantic_map.points())
    assert set(loaded.semantic_map.labels()) >= {Label.WALL, Label.TERRAIN}
    np.testing.assert_array_equal(loaded.semantic_map.labels(), mapper.semantic_map.labels())
    np.testing.assert_array_equal(loaded.elevation_map.elevation, mapper.elevation_map.elevation)
    assert [(s.id, s.label, s.members) for s in loaded.segments] == [
        (s.id, s.label, s.members) for s in mapper.segments
    ]
    before, after = (m.localisation.keyframes().odometry for m in (mapper, loaded))
    assert before.errors.any() and (after.errors == before.errors).all()
    np.testing.assert_allclose(loaded.localisation.points(), mapper.localisation.points(), atol=1e-3)
    (before,), (victim,) = mapper.victims.all, loaded.victims.all
    np.testing.assert_allclose(victim.position, before.position, atol=1e-3)
    np.testing.assert_allclose(victim.covariance, before.covariance)
    np.testing.assert_array_equal(victim.photo, before.photo)
    assert victim.photo.size
    assert ([seen.reading.confidence for seen in victim.seen], victim.missed) == ([0.7, 0.8], {1, 3})
    (code,), (find,) = mapper.finds.all, loaded.finds.all
    assert (find.policy.kind, find.text, find.missed, len(find.tried)) == ("qr_code", code.text, {3}, 1)
    np.testing.assert_allclose(find.position, code.position, atol=1e-3)
    np.testing.assert_allclose(find.covariance, np.eye(3) / 9, atol=1e-9)
    np.testing.assert_array_equal(find.to_find().photo, code.to_find().photo)
    np.testing.assert_allclose(best_returns(find), best_returns(code), atol=1e-3)
    np.testing.assert_allclose(victim.tried_at, before.tried_at)
    np.testing.assert_allclose(victim.camera_positions[1], before.camera_positions[1])
    assert [len(seen.walls) for seen in victim.placed] == [0, 1]
    np.testing.assert_allclose(victim.placed[1].walls, before.placed[1].walls, atol=1e-6)


def test_new_keyframes_join_those_that_stay_where_they_were(mapper, file):
    loaded = new_mapper()
    load_keyframes(file, loaded)
    assert loaded.T_map_start is None
    T = mapper.keyframes.poses[1] @ from_yaw(0.1, 0, 0, 0.05)
    loaded.localisation.set_pose(from_yaw(0.05, 0.03, 0, 0) @ T)
    loaded.add_frame(loaded.localise(seen_from(T, np.eye(4), seed=9)))
    loaded.apply_corrections()
    np.testing.assert_allclose(loaded.keyframes.poses[:4], mapper.keyframes.poses, atol=1e-3)
    np.testing.assert_allclose(loaded.keyframes.poses[4], loaded.T_map_start)
    x, y, _ = loaded.keyframes.poses[4, :3, 3] - T[:3, 3]
    assert abs(x) < 0.03  # along x the wall shows where it is
    assert abs(y) < 0.04  # along the wall it is where it was set down


def test_a_map_that_was_continued_with_a_larger_image_is_saved_too(mapper, file, tmp_path):
    loaded = new_mapper()
    load_keyframes(file, loaded)
    T = mapper.keyframes.poses[1] @ from_yaw(0.1, 0, 0, 0.05)
    loaded.localisation.set_pose(T)
    loaded.add_frame(loaded.localise(seen_from(T, np.eye(4), camera=Intrinsics(400, 300, 300, 300, 200, 150))))
    save_keyframes(loaded, tmp_path / "both.npz")
    both = new_mapper()
    load_keyframes(tmp_path / "both.npz", both)
    depths = [[seen.depth for seen in m.keyframes.observations] for m in (loaded, both)]
    assert depths[0][-1].shape != depths[0][0].shape
    for before, after in zip(*depths, strict=True):
        np.testing.assert_array_equal(after, before)
    np.testing.assert_array_equal(both.metric_map.occupied_centres(), loaded.metric_map.occupied_centres())


@cache
def entries_of(file: Path) -> dict[str, np.ndarray]:
    with np.load(file) as content:
        return dict(content)


def changed(file: Path, folder: Path, **entries: object) -> Path:
    np.savez(folder / "changed.npz", **entries_of(file) | entries)
    return folder / "changed.npz"


ENTRIES = [f"{kind}.{name}" for kind, fields in LAYOUT.items() for name in fields]
LENGTHS = [f"{kind}.{name}.lengths" for kind, fields in LAYOUT.items() for name, f in fields.items() if varies(f)]


@pytest.mark.parametrize(("turn", "name"), list(enumerate(ENTRIES + LENGTHS)))
def test_an_entry_of_wrong_type_length_or_value_is_refused_in_one_line(file, tmp_path, turn, name):
    """Each entry is wrong in one way; the ways take turns, for one check reads all entries."""
    value = entries_of(file)[name]
    broken = [value.astype(np.complex64), value[..., None], np.concatenate([value, np.ones_like(value[:1])])]
    broken = broken if len(value) else broken[:2]
    broken += [np.full_like(value, np.nan)] if value.dtype.kind == "f" else []
    bad = changed(file, tmp_path, **{name: broken[turn % len(broken)]})
    with pytest.raises(InputError) as error:
        load_keyframes(bad, new_mapper())
    assert "changed.npz: " in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("format", "sarsim metric map", "changed.npz"),
        ("version", 3, f"version {VERSION}"),
        ("member.keyframe", -1, "keyframe"),
        ("driven.keyframe", 4, "keyframe"),
        ("track.tried_from", 4, "keyframe"),
        ("track.missed", 4, "keyframe"),
        ("keyframe.T_map_base", 2.0, "pose"),
        ("keyframe.points.lengths", -2, "keyframe.points"),
        ("keyframe.camera", 0.0, "focal length"),
        ("member.label", 12, "class"),
        ("keyframe.classes", 8, "class"),
        ("odometry.covariance", 0.0, "odometry"),
        ("track.observations", 0, "victim"),
    ],
)
def test_numbers_that_make_no_sense_are_refused(file, tmp_path, name, value, reason):
    bad = np.full_like(entries_of(file)[name], value) if name in ENTRIES + LENGTHS else np.array(value)
    with pytest.raises(InputError, match=reason):
        load_keyframes(changed(file, tmp_path, **{name: bad}), new_mapper())


@pytest.mark.parametrize(("place", "reason"), [(1e3, "GB"), (1e9, "8192 m")])
def test_a_keyframe_far_away_allocates_nothing(file, tmp_path, place, reason):
    poses = entries_of(file)["keyframe.T_map_base"].copy()
    poses[-1, :2, 3] = place
    bad = changed(file, tmp_path, **{"keyframe.T_map_base": poses})
    with pytest.raises(InputError, match=reason):
        load_keyframes(bad, new_mapper())
    with pytest.raises(InputError, match=reason):
        load_elevation_map(bad, PIONEER)


def test_files_that_are_none_are_refused(file, tmp_path):
    half = tmp_path / "half.npz"
    half.write_bytes(file.read_bytes()[:5000])
    text = tmp_path / "text.npz"
    text.write_text("no map")
    for path in (tmp_path / "missing.npz", half, text, tmp_path):
        with pytest.raises(InputError, match=path.name) as error:
            load_keyframes(path, new_mapper())
        assert "\n" not in str(error.value)


def test_a_map_continued_with_odometry_alone_keeps_its_surfaces_and_can_be_continued_with_slam(
    mapper, file, tmp_path
):
    taken = Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation())
    load_keyframes(file, taken)
    T = mapper.keyframes.poses[-1] @ from_yaw(0.1, 0, 0, 0.05)
    taken.add_frame(LocalisedFrame(seen_from(T, T), T))
    save_keyframes(taken, tmp_path / "taken.npz")
    again = new_mapper()
    load_keyframes(tmp_path / "taken.npz", again)
    before, after = mapper.localisation.keyframes(), again.localisation.keyframes()
    assert len(after.poses) == len(after.ups) == len(before.poses) + 1
    np.testing.assert_allclose(after.ups[-1], T[2, :3], atol=1e-6)
    np.testing.assert_array_equal(after.points.astype(np.float32), before.points.astype(np.float32))
    np.testing.assert_array_equal(after.owner, before.owner)
    np.testing.assert_array_equal(after.odometry.errors, before.odometry.errors)


def test_nobody_finds_a_place_in_a_map_without_registered_points(tmp_path):
    taken = Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation())
    taken.add_frame(LocalisedFrame(seen_from(POSES[0], POSES[0]), POSES[0]))
    save_keyframes(taken, tmp_path / "taken.npz")
    with pytest.raises(InputError, match=r"taken.npz.*--localisation slam"):
        load_keyframes(tmp_path / "taken.npz", new_mapper())
    again = Mapper(PIONEER, TruthClassifier(), localisation=OdometryLocalisation())
    load_keyframes(tmp_path / "taken.npz", again)
    np.testing.assert_array_equal(again.localisation.poses, again.keyframes.poses)
