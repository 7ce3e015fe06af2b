"""Culling must not leave out geoms that an image shows."""

import mujoco
import numpy as np
import pytest

from sarsim.sensors import culling
from sarsim.sensors.rendering import Renderer, fixed_camera

LIGHTS = {
    "spot": '<light pos="1 -1 3" dir="0 0 -1" cutoff="80" castshadow="true"/>',
    "low spot": '<light pos="0 0 0.9" dir="0 0 -1" cutoff="80" castshadow="true"/>',
    "directional": '<light type="directional" dir="0.5 0.3 -1" castshadow="true"/>',
    "upwards": '<light type="directional" dir="0.5 0 0.2" castshadow="true"/>',
    "none casts": '<light pos="1 -1 3" dir="0 0 -1" castshadow="false"/>',
}
# Along +x, 45 degrees up and down, 53.13 degrees (tangent 4/3) to either side.
CAMERA = '<camera name="eye" xyaxes="0 -1 0 0 0 1" fovy="90"/>'


def scene(body: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(f'<mujoco><statistic extent="8"/><worldbody>{body}</worldbody></mujoco>')
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def crowd(light: str, rng: np.random.Generator) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Things of all shapes scattered over a floor, and a body with a camera."""
    shapes = ("sphere", "capsule", "cylinder", "box", "ellipsoid")
    geoms = "".join(
        f'<geom type="{shapes[i % 5]}" size="0.2 0.15 0.3" pos="{x} {y} {z}" euler="{40 * i} {70 * i} 0"/>'
        for i, (x, y, z) in enumerate(rng.uniform((-4, -4, 0), (4, 4, 1.2), (40, 3)))
    )
    body = f'<geom type="plane" size="0 0 1"/><body name="rig" mocap="true">{CAMERA}</body>{geoms}{light}'
    return scene(body)


@pytest.mark.parametrize("light", LIGHTS.values(), ids=LIGHTS.keys())
def test_pictures_are_the_same_as_with_everything_drawn(light: str, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    model, data = crowd(light, rng)
    drawn = 0
    with Renderer(model, 160, 120) as renderer:
        for _ in range(6):
            data.mocap_pos[0] = rng.uniform((-3, -3, 0.2), (3, 3, 1.5))
            data.mocap_quat[0] = rng.normal(size=4) * (1, 0.1, 0.1, 1)
            mujoco.mj_forward(model, data)
            colour, (geom, depth) = renderer.colour(data, "eye"), renderer.segmentation_and_depth(data, "eye")
            drawn += len(np.unique(geom))
            with monkeypatch.context() as patch:
                for name in ("visible_geoms", "visible_or_shadowing_geoms"):
                    patch.setattr(culling, name, lambda model, *_: np.ones(model.ngeom, np.bool_))
                all_colour = renderer.colour(data, "eye")
                all_geom, all_depth = renderer.segmentation_and_depth(data, "eye")
            np.testing.assert_array_equal(colour, all_colour)
            np.testing.assert_array_equal(geom, all_geom)
            np.testing.assert_array_equal(depth, all_depth)
    assert drawn > 30


@pytest.fixture
def planes() -> np.ndarray:
    """The camera's frustum."""
    model, data = scene(CAMERA + '<geom type="sphere" size="1"/>')
    view, views = fixed_camera(model, "eye"), mujoco.MjvScene(model, 1)
    mujoco.mjv_updateCamera(model, data, view, views)
    return culling.frustum(mujoco.mjv_averageCamera(*views.camera), 160 / 120)


def test_frustum_is_that_of_the_camera(planes: np.ndarray) -> None:
    right, left, below, above, behind = [4, 3, 0], [4, -3, 0], [1, 0, 1], [1, 0, -1], [1, 0, 0]
    expected = np.array([left, right, below, above, behind], np.float64)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(planes[:, :3], expected, atol=1e-6)
    np.testing.assert_allclose(planes[:, 3], 0, atol=1e-6)


@pytest.mark.parametrize(
    ("position", "seen"),
    [
        ("3 0 0", True),
        ("-3 0 0", False),
        ("3 3.9 0", True),
        ("3 4.3 0", True),  # only its edge
        ("3 4.6 0", False),
        ("3 0 3.2", True),
        ("3 0 3.4", False),
    ],
)
def test_a_ball_is_drawn_where_it_can_be_seen(position: str, seen: bool, planes: np.ndarray) -> None:
    model, data = scene(f'<geom type="sphere" size="0.2" pos="{position}"/>')
    assert culling.visible_geoms(model, data, planes)[0] == seen


@pytest.mark.parametrize(
    ("light", "needed"),
    [
        ('<light pos="3 0 9" dir="0 0 -1"/>', True),  # the shadow falls straight down into the picture
        ('<light pos="9 0 6" dir="0 0 -1"/>', False),  # it falls behind the camera
        ('<light type="directional" dir="1 0 -0.2"/>', True),  # it crosses the picture far away
        ('<light type="directional" dir="-1 0 -0.2"/>', False),
        ('<light type="directional" dir="-1 0 0.2"/>', True),  # no floor ends it
        ('<light pos="3 0 4" dir="0 0 -1"/>', True),  # the ball is above the light
        ('<light pos="3 0 9" dir="0 0 -1" castshadow="false"/>', False),
        ('<light pos="3 0 9" dir="0 0 -1" active="false"/>', False),
    ],
)
def test_a_hidden_ball_is_drawn_for_its_shadow(light: str, needed: bool, planes: np.ndarray) -> None:
    model, data = scene(
        f'<geom type="sphere" size="0.2" pos="3 0 5"/><geom type="plane" size="9 9 1" pos="0 0 -1"/>{light}'
    )
    assert not culling.visible_geoms(model, data, planes)[0]
    assert culling.visible_or_shadowing_geoms(model, data, planes)[0] == needed
