"""Pictures of small scenes whose geometry is known."""

import subprocess
import sys
from importlib.util import find_spec

import mujoco
import numpy as np
import pytest

from pipeline.errors import InputError
from sarsim.sensors import culling
from sarsim.sensors.rendering import Renderer, fixed_camera

# Cameras look along +x from the origin, up is z: the image's left is +y.
CAMERA = 'name="eye" xyaxes="0 -1 0 0 0 1" fovy="45"'


def scene(geoms: str, head: str = "") -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco>{head}<statistic extent='10'/><worldbody><light pos='0 0 5' dir='1 0 -1'/>"
        f"<camera {CAMERA}/>{geoms}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


TWO_BOXES = (
    '<geom name="far" type="box" size="0.1 9 9" pos="4.1 0 0" rgba="0 0 1 1"/>'
    '<geom name="near" type="box" size="0.1 0.4 0.4" pos="1.6 0.3 0.2" euler="25 0 0" rgba="1 0 0 1"/>'
)


@pytest.mark.parametrize("distance", [0.3, 1.7, 6.0])
def test_depth_of_a_wall_is_its_distance(distance: float) -> None:
    model, data = scene(f'<geom type="box" size="0.1 20 20" pos="{distance + 0.1} 0 0"/>')
    with Renderer(model, 160, 120) as renderer:
        geom, depth = renderer.segmentation_and_depth(data, "eye")
    assert (geom == 0).all()
    np.testing.assert_allclose(depth, distance, atol=2e-5)


def test_nothing_hit_has_no_id_and_no_depth() -> None:
    model, data = scene('<geom type="sphere" size="0.2" pos="2 0 0"/>')
    with Renderer(model, 160, 120) as renderer:
        geom, depth = renderer.segmentation_and_depth(data, "eye")
    assert geom.dtype == np.int32
    assert depth.dtype == np.float32
    assert set(np.unique(geom)) == {-1, 0}
    assert ((geom == -1) == (depth == 0)).all()


def test_ids_and_depths_agree_at_slanted_edges() -> None:
    model, data = scene(TWO_BOXES)
    with Renderer(model, 320, 240) as renderer:
        geom, depth = renderer.segmentation_and_depth(data, "eye")
    near = geom == model.geom("near").id
    assert 1000 < near.sum() < geom.size / 2
    np.testing.assert_allclose(depth[near], 1.5, atol=1e-4)
    np.testing.assert_allclose(depth[~near], 4.0, atol=1e-4)


def test_ids_beyond_one_byte() -> None:
    count = 300
    balls = "".join(
        f'<geom type="sphere" size="0.02" pos="2 {0.8 - 0.08 * (i % 20)} {0.6 - 0.08 * (i // 20)}"/>'
        for i in range(count)
    )
    model, data = scene(balls)
    with Renderer(model, 320, 240) as renderer:
        geom, _ = renderer.segmentation_and_depth(data, "eye")
    rows, columns = np.nonzero(geom == 280)  # in the 15th row of balls, the leftmost
    assert set(np.unique(geom)) == set(range(-1, count))
    assert rows.mean() > 180
    assert columns.mean() < 80


def test_pictures_are_upright() -> None:
    model, data = scene('<geom type="sphere" size="0.1" pos="2 0.5 0.4" rgba="1 0 0 1"/>')
    with Renderer(model, 160, 120) as renderer:
        geom, _ = renderer.segmentation_and_depth(data, "eye")
        colour = renderer.colour(data, "eye")
    rows, columns = np.nonzero(geom == 0)
    assert rows.max() < 60  # +z is up
    assert columns.max() < 80  # +y is left
    red = colour[..., 0].astype(int) - colour[..., 1] > 30
    np.testing.assert_allclose(np.argwhere(red).mean(axis=0), [rows.mean(), columns.mean()], atol=3)


def test_collision_geoms_and_sites_are_hidden() -> None:
    model, data = scene(
        '<geom type="box" size="0.1 9 9" pos="3 0 0"/><geom type="box" size="0.1 9 9" pos="2 0 0" group="3"/>'
        '<site type="box" size="0.1 9 9" pos="1 0 0"/>'
    )
    with Renderer(model, 160, 120) as renderer:
        geom, depth = renderer.segmentation_and_depth(data, "eye")
    assert (geom == 0).all()
    np.testing.assert_allclose(depth, 2.9, atol=1e-4)


def test_passes_do_not_disturb_each_other_and_repeat_exactly() -> None:
    model, data = scene(TWO_BOXES)
    with Renderer(model, 160, 120) as renderer:
        colour, ids = renderer.colour(data, "eye"), renderer.segmentation_and_depth(data, "eye")
        again, ids_again = renderer.colour(data, "eye"), renderer.segmentation_and_depth(data, "eye")
    with Renderer(model, 160, 120) as second:
        ids_second = second.segmentation_and_depth(data, "eye")
        colour_second = second.colour(data, "eye")
    for other in (again, colour_second):
        np.testing.assert_array_equal(colour, other)
    for other_ids in (ids_again, ids_second):
        np.testing.assert_array_equal(ids[0], other_ids[0])
        np.testing.assert_array_equal(ids[1], other_ids[1])


def test_a_picture_is_not_overwritten_by_the_next_one() -> None:
    model, data = scene(TWO_BOXES)
    with Renderer(model, 160, 120) as renderer:
        colour = renderer.colour(data, "eye")
        before = colour.copy()
        away = fixed_camera(model, "eye")
        away.type = mujoco.mjtCamera.mjCAMERA_FREE
        away.lookat[:], away.distance = (0, 0, 0), 20
        other = renderer.colour(data, away)
    np.testing.assert_array_equal(colour, before)
    assert (other != before).any()


def test_the_model_keeps_its_own_quality() -> None:
    head = '<visual><quality offsamples="8" shadowsize="2048"/><global offwidth="100" offheight="100"/></visual>'
    model, data = scene(TWO_BOXES, head)
    with Renderer(model, 320, 240) as renderer:
        assert renderer.colour(data, "eye").shape == (240, 320, 3)
    assert model.vis.quality.offsamples == 8
    assert model.vis.quality.shadowsize == 2048
    assert (model.vis.global_.offwidth, model.vis.global_.offheight) == (100, 100)


@pytest.mark.parametrize("diffuse", [0.0, 0.7])
def test_only_a_light_that_shines_casts_a_shadow(diffuse: float) -> None:
    model, data = scene(TWO_BOXES)
    model.light_ambient[0], model.light_diffuse[0], model.light_specular[0] = 0, diffuse, 0
    with Renderer(model, 160, 120) as renderer:
        shadowed = renderer.colour(data, "eye")
        model.light_castshadow[0] = False
        plain = renderer.colour(data, "eye")
    assert (shadowed != plain).any() == (diffuse > 0)


def test_a_floor_casts_no_shadow_but_an_awning_does() -> None:
    box = '<geom type="box" size="0.5 0.5 0.05" pos="3 0 -0.9"/>'
    floor, awning = ('<geom type="plane" size="9 9 1" pos="{} 0 {}"/>'.format(*at) for at in ((9, -1), (3, 1.5)))
    for geoms, expected in ((floor + box, [True, False]), (awning + box, [False, False])):
        model, data = scene(geoms)
        np.testing.assert_array_equal(culling.shadowless_planes(model, data), expected)


def test_a_picture_does_not_miss_the_shadow_of_the_floor(monkeypatch: pytest.MonkeyPatch) -> None:
    box = '<geom type="box" size="0.2 0.5 0.3" pos="3 0.2 -0.7" euler="0 0 30"/>'
    model, data = scene('<geom type="plane" size="9 9 1" pos="0 0 -1"/>' + box)
    with Renderer(model, 160, 120) as renderer:
        picture = renderer.colour(data, "eye")
        monkeypatch.setattr(culling, "shadowless_planes", lambda model, data: np.zeros(model.ngeom, np.bool_))
        np.testing.assert_array_equal(renderer.colour(data, "eye"), picture)


@pytest.mark.parametrize("camera", ["nose", 1, -1])
def test_an_unknown_camera_is_named(camera: str | int) -> None:
    model, _ = scene(TWO_BOXES)
    with pytest.raises(InputError, match=f"no camera {camera!r}"):
        fixed_camera(model, camera)


@pytest.mark.skipif(find_spec("triton") is None, reason="no triton, which comes with PyTorch for CUDA")
def test_a_process_that_renders_trains_too():
    """Mesa's LLVM and that of triton, which PyTorch imports here, do not conflict."""
    imports = "import sarsim.sensors.rendering, dm_control.mjcf, torch"
    code = f"{imports}; torch.optim.AdamW([torch.zeros(1).requires_grad_()])"
    subprocess.run([sys.executable, "-c", code], check=True)
