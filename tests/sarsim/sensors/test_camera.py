"""The labelled frame against MuJoCo's own ray casting, and its poses, labels and intrinsics."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.frame import Intrinsics
from pipeline.transforms import transform_points
from sarsim.sensors.camera import LabelledImage, RgbdCamera, camera_intrinsics, geom_labels, geom_objects
from sarsim.sensors.rendering import Renderer

ARENA = Path(__file__).parents[3] / "assets/arenas/nist_6x4.xml"
SQUARE = 'fovy="45"'
ROBOT = ("bonnet", "mast", "lip")
CROOKED = 'resolution="640 480" sensorsize="0.64 0.48" focal="0.55 0.6" principal="0.05 -0.03"'

SCENE = """
<mujoco>
  <compiler angle="degree" eulerseq="XYZ"/>
  <size nuser_geom="1"/>
  <statistic extent="10"/>
  <visual><map znear="0.002" zfar="5"/></visual>
  <asset>
    <mesh name="wedge" vertex="-0.3 -0.6 0  -0.3 0.6 0  0.3 -0.6 0  0.3 0.6 0  0.3 -0.6 0.17  0.3 0.6 0.17"/>
  </asset>
  <worldbody>
    <light pos="0 0 4"/>
    <geom name="floor" type="plane" size="7 7 1" user="2"/>
    <geom name="north" type="box" size="6 0.05 0.6" pos="0 3 0.6" user="1"/>
    <geom name="east" type="box" size="0.05 6 0.6" pos="6 0 0.6" user="1"/>
    <geom name="panel" type="box" size="0.02 0.5 0.5" pos="2.2 -1 0.5" euler="0 0 30" user="1"/>
    <geom name="ramp" type="mesh" mesh="wedge" pos="1.6 0.8 0" euler="0 0 20" user="3"/>
    <geom name="deck" type="box" size="0.4 0.6 0.085" pos="2.6 1.1 0.085" euler="0 0 20" user="4"/>
    <geom name="barrel" type="cylinder" size="0.3 0.45" pos="3 -0.2 0.45" user="7"/>
    <geom name="pipe" type="cylinder" size="0.05 0.5" pos="0.9 -0.35 0.5" euler="20 0 0" user="7"/>
    <geom name="head" type="sphere" size="0.12" pos="1.2 0.1 0.3" user="6"/>
    <geom name="leg" type="capsule" size="0.08 0.3" pos="1.7 0.1 0.08" euler="90 0 10" user="6"/>
    <geom name="speck" type="box" size="0.03 0.03 0.03" pos="0.45 0.1 0.45"/>
    <body name="robot" pos="{pose}" euler="{turn}">
      <freejoint/>
      <geom name="bonnet" type="box" size="0.25 0.2 0.05" pos="0 0 0.2" user="7"/>
      <body pos="0.1 0 0.5" euler="0 {tilt} 0">
        <geom name="mast" type="box" size="0.02 0.02 0.2" pos="0 0 -0.3"/>
        <geom name="lip" type="box" size="0.02 0.2 0.01" pos="0.2 0 -0.07"/>
        <camera name="camera" xyaxes="0 -1 0 0 0 1" {camera}/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def load(xml: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def robot_scene(
    pose: str = "0 0 0", turn: str = "0 0 0", tilt: float = 15, camera: str = SQUARE
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    return load(SCENE.format(pose=pose, turn=turn, tilt=tilt, camera=camera))


def look(model: mujoco.MjModel, data: mujoco.MjData) -> LabelledImage:
    with Renderer(model) as renderer:
        return RgbdCamera(renderer, "camera").capture(data)


def cast(
    model: mujoco.MjModel, data: mujoco.MjData, image: LabelledImage
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """(H, W) geom ids and (H, W, 3) points that rays through the pixels' centres hit; -1 and nan without a hit."""
    origin = image.T_world_camera[:3, 3].copy()
    rays = (image.intrinsics.rays @ image.T_world_camera[:3, :3].T).reshape(-1, 3).astype(np.float64)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    geom, distance = np.full(len(rays), -1, np.int32), np.zeros(len(rays))
    groups = np.array([1, 1, 1, 0, 0, 0], np.uint8)
    mujoco.mj_multiRay(
        model, data, origin, rays.ravel(), groups, True, -1, geom, distance, None, len(rays), mujoco.mjMAXVAL
    )
    points = np.where(geom[:, None] < 0, np.nan, origin + rays * distance[:, None])
    return geom.reshape(image.depth.shape), points.reshape(*image.depth.shape, 3)


def share_on_surface(
    model: mujoco.MjModel, data: mujoco.MjData, image: LabelledImage, own: tuple[str, ...] = ()
) -> float:
    """Share of the pixels with the ray's geom and a point within 5 mm of its hit; geoms ``own`` give no return."""
    geom, hits = cast(model, data, image)
    geom[np.isin(geom, [model.geom(name).id for name in own])] = -1
    points = (image.intrinsics.rays * image.depth[..., None]).reshape(-1, 3)
    points = transform_points(image.T_world_camera, points).reshape(hits.shape)
    near = np.linalg.norm(points - hits, axis=-1) <= 0.005
    return float(np.mean((geom == image.instance) & ((geom < 0) | near)))


@pytest.mark.parametrize("camera", [SQUARE, CROOKED])
@pytest.mark.parametrize(
    ("pose", "turn", "tilt"), [("0 0 0", "0 0 0", 15), ("-0.6 0.3 0.1", "3 -5 -20", 20), ("1.0 -1.5 0", "0 8 65", 15)]
)
def test_points_lie_where_rays_hit(pose: str, turn: str, tilt: float, camera: str) -> None:
    model, data = robot_scene(pose, turn, tilt, camera)
    image = look(model, data)
    returns = image.depth[image.depth > 0]
    assert returns.min() < 1.2
    assert returns.max() > 3.0
    assert share_on_surface(model, data, image, ROBOT) >= 0.999


@pytest.mark.parametrize(
    ("position", "target"), [((-2.3, -1.3, 0.55), (0.0, -1.4, 0.0)), ((2.5, 1.2, 0.75), (0.0, 1.3, 0.1))]
)
def test_points_lie_where_rays_hit_in_the_arena(
    position: tuple[float, float, float], target: tuple[float, float, float]
) -> None:
    spec = mujoco.MjSpec.from_file(str(ARENA))
    camera = spec.worldbody.add_camera(name="camera", pos=position, fovy=45)
    forward = np.subtract(target, position)
    right = np.cross(forward, (0, 0, 1))
    camera.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
    camera.alt.xyaxes = [*right, *np.cross(right, forward)]
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    image = look(model, data)
    assert share_on_surface(model, data, image) >= 0.999
    np.testing.assert_array_equal(image.label, np.append(geom_labels(model), 0)[image.instance])


def test_the_robot_gives_no_return_but_has_a_colour() -> None:
    model, data = robot_scene(tilt=40)
    with Renderer(model) as renderer:
        image = RgbdCamera(renderer, "camera").capture(data)
        geom, _ = renderer.segmentation_and_depth(data, "camera")
    own = np.isin(geom, [model.geom(name).id for name in ROBOT])
    assert own.sum() > 1000
    assert (image.depth[own] == 0).all()
    assert (image.label[own] == 0).all()
    assert (image.instance[own] == -1).all()
    assert image.rgb[own].any()


def test_pose_in_the_robot_is_where_the_model_has_the_camera() -> None:
    _, moved = robot_scene("1 -1.5 0", "0 8 65", tilt=0)
    image = look(*robot_scene("1 -1.5 0", "0 8 65", tilt=0))
    forward_right_down = [[0, 0, 1, 0.1], [-1, 0, 0, 0], [0, -1, 0, 0.5], [0, 0, 0, 1]]
    np.testing.assert_allclose(image.T_base_camera, forward_right_down, atol=1e-9)
    np.testing.assert_allclose(image.T_world_camera[:3, 3], moved.cam_xpos[0], atol=1e-12)
    assert image.T_world_camera[2, 2] == pytest.approx(-np.sin(np.radians(8)))  # nose down by 8 degrees


def test_a_camera_of_the_world_sees_everything() -> None:
    model, data = load(
        '<mujoco><worldbody><geom type="box" size="0.1 9 9" pos="2.1 0 0"/>'
        '<camera name="camera" xyaxes="0 -1 0 0 0 1"/></worldbody></mujoco>'
    )
    image = look(model, data)
    assert (image.instance == 0).all()
    np.testing.assert_allclose(image.T_base_camera, image.T_world_camera)
    assert (image.label == 0).all()  # a model without user numbers


THINGS = """<mujoco><size nuser_geom="1"/><worldbody><geom type="plane" size="9 9 1" user="2"/>
<body name="person"><geom size="1" user="6"/><body><geom size="1" user="6"/></body><geom size="1" user="7"/></body>
<geom size="1" user="1"/><geom size="1" user="1"/><body><geom size="1" user="6"/><geom size="1" user="6"/></body>
</worldbody></mujoco>"""


def test_geoms_of_one_body_and_label_are_one_object_and_those_of_the_world_are_their_own() -> None:
    model, _ = load(THINGS)
    floor, wall, other_wall, trunk, seat, arm, other_head, other_trunk = range(8)
    objects = geom_objects(model)
    assert objects[arm] == objects[trunk] and objects[other_head] == objects[other_trunk]
    different = [floor, wall, other_wall, trunk, seat, other_head]
    assert objects[different].tolist() == different and objects[-1] == -1


def test_intrinsics_of_a_field_of_view() -> None:
    model, _ = robot_scene(camera='fovy="90"')
    assert intrinsics_tuple(camera_intrinsics(model, 0, 640, 480)) == pytest.approx((240, 240, 320, 240))


def test_intrinsics_of_a_sensor_scale_with_the_picture() -> None:
    model, _ = robot_scene(camera=CROOKED)
    assert intrinsics_tuple(camera_intrinsics(model, 0, 640, 480)) == pytest.approx((550, 600, 270, 270))
    assert intrinsics_tuple(camera_intrinsics(model, 0, 320, 240)) == pytest.approx((275, 300, 135, 135))


def intrinsics_tuple(intrinsics: Intrinsics) -> tuple[float, float, float, float]:
    return intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy


@pytest.mark.parametrize("user", ["8", "-1", "1.5"])
def test_a_number_that_is_no_label_is_named(user: str) -> None:
    model, _ = load(
        f'<mujoco><worldbody><geom name="odd" type="sphere" size="1" user="{user}"/></worldbody></mujoco>'
    )
    with pytest.raises(InputError, match=f"'odd' has user={user}, .* from 0 to 7"):
        geom_labels(model)
