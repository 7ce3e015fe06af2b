"""One scene of the NIST arena and one of a random arena, held against their own MJCF."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.labels import Label
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.render import render_scene
from sarsim.dataset.scene_file import Scene
from sarsim.dataset.settings import ArenaRange

CLEAR = Recipe(seed=1, frames=16, width=160, height=120, arenas=("nist_6x4",), ideal=1, clear=1)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path = tmp_path_factory.mktemp("scene") / "scene.h5"
    render_scene(CLEAR, 0, path)
    return Scene(path)


@pytest.fixture(scope="module")
def world(scene: Scene) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The arena, from the text in the file alone."""
    model = mujoco.MjModel.from_xml_string(scene.content.mjcf)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def test_every_point_lies_on_the_geom_that_it_names(
    scene: Scene, world: tuple[mujoco.MjModel, mujoco.MjData]
) -> None:
    """Rays from the true camera through the arena of the MJCF end where the points are, on the same geoms."""
    model, data = world
    names, hits, total = scene.content.geom_name, 0, 0
    rng = np.random.default_rng(0)
    for index in range(0, len(scene), 3):
        frame = scene.frame(index)
        camera = scene.T_world_camera(index)[:3, 3]
        points = frame.points(scene.T_world_camera(index)).astype(np.float64)
        instance = frame.instance[frame.returns]
        for n in rng.choice(len(points), 60, replace=False):
            ray, geom = points[n] - camera, np.full(1, -1, np.int32)
            far = mujoco.mj_ray(model, data, camera, ray, None, 1, -1, geom)
            hits += abs(far - 1) * np.linalg.norm(ray) < 0.006 and model.geom(geom[0]).name == names[instance[n]]
            total += 1
    # A ray to the rounded depth of a pixel on an edge may pass the edge.
    assert hits / total > 0.99


def test_labels_are_those_of_the_geoms(scene: Scene, world: tuple[mujoco.MjModel, mujoco.MjData]) -> None:
    model, _ = world
    by_name = {model.geom(g).name: int(model.geom_user[g, 0]) for g in range(model.ngeom)}
    content, seen = scene.content, set()
    for frame in scene:
        shown = frame.instance >= 0
        np.testing.assert_array_equal(frame.label[shown], content.geom_label[frame.instance[shown]])
        assert (frame.label[~shown] == Label.UNLABELLED).all()
        seen |= set(np.unique(frame.instance[shown]).tolist())
    assert len(seen) > 10
    assert all(by_name[content.geom_name[g]] == content.geom_label[g] for g in seen)


def test_victims_are_where_the_mjcf_has_them(scene: Scene, world: tuple[mujoco.MjModel, mujoco.MjData]) -> None:
    _, data = world
    content = scene.content
    assert content.victim_id
    for name, pose in zip(content.victim_id, content.victim_pose, strict=True):
        body = data.body(f"victim_{name}")
        np.testing.assert_allclose(pose[:3, 3], body.xpos, atol=1e-6)
        np.testing.assert_allclose(pose[:3, :3].ravel(), body.xmat, atol=1e-6)


def test_boxes_enclose_what_is_seen_of_each_victim(scene: Scene) -> None:
    of_geom = np.append(scene.content.geom_victim, -1)
    met = 0
    for index, frame in enumerate(scene):
        victim = of_geom[frame.instance]
        for number in range(len(scene.content.victim_id)):
            rows, columns = np.nonzero(victim == number)
            assert scene.victim_area[index, number] == len(rows)
            box = scene.victim_pixels[index, number]
            if len(rows):
                expected = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
                np.testing.assert_array_equal(box, expected)
                met += 1
            else:
                assert (box == -1).all()
    assert met


def test_a_victim_is_one_object(scene: Scene) -> None:
    content = scene.content
    for number in range(len(content.victim_id)):
        mine = content.geom_victim == number
        assert len(np.unique(content.geom_object[mine])) == 1 < mine.sum()
        assert not np.isin(content.geom_object[~mine], content.geom_object[mine]).any()


def test_points_of_a_victim_lie_in_its_box(scene: Scene) -> None:
    content, met = scene.content, 0
    for index, frame in enumerate(scene):
        points = frame.points(scene.T_world_camera(index))
        victim = content.geom_victim[frame.instance[frame.returns]]
        for number, (pose, (low, high)) in enumerate(zip(content.victim_pose, content.victim_box, strict=True)):
            mine = (points[victim == number] - pose[:3, 3]) @ pose[:3, :3]
            assert (mine > low - 0.01).all() and (mine < high + 0.01).all()
            met += len(mine)
    assert met


def test_the_floor_is_flat_at_the_true_pose_and_less_so_by_odometry(scene: Scene) -> None:
    def spread(poses: np.ndarray) -> float:
        heights = []
        for index, frame in enumerate(scene):
            points = frame.points(poses[index] @ scene.T_base_camera[index])
            heights.append(points[frame.label[frame.returns] == Label.TERRAIN, 2])
        return float(np.percentile(np.abs(np.concatenate(heights)), 95))

    assert spread(scene.pose_true) < 0.003
    assert spread(scene.pose_odom) > 0.003


def test_a_random_arena_is_rendered(tmp_path: Path) -> None:
    recipe = Recipe(seed=5, frames=2, width=64, height=48, random=ArenaRange(tiles=(4, 4), victims=(1, 1)))
    render_scene(recipe, 1, tmp_path / "scene.h5")
    with Scene(tmp_path / "scene.h5") as scene:
        assert scene.settings["arena"].startswith("random:")
        assert scene.settings["random"]["columns"] == 4
        assert len(scene.content.victim_id) == 1
        assert {Label.WALL, Label.TERRAIN} <= set(np.unique(scene.label(0)))


def test_a_continuous_drive_has_a_frame_every_so_often(tmp_path: Path) -> None:
    recipe = replace(CLEAR, frames=6, frames_per_second=10.0)
    render_scene(recipe, 0, tmp_path / "scene.h5")
    with Scene(tmp_path / "scene.h5") as scene:
        np.testing.assert_allclose(np.diff(scene.time), 0.1)
        steps = np.linalg.norm(np.diff(scene.pose_true[:, :2, 3], axis=0), axis=1)
        assert steps.max() <= 0.021  # 0.2 m/s
    with pytest.raises(InputError, match="--frames-per-second 100"):
        replace(recipe, frames_per_second=100)
