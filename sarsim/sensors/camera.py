"""The robot's RGB-D camera without noise, and the true label of every pixel."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Depth, Labels, Pose, Rgb
from pipeline.errors import InputError
from pipeline.frame import Frame, Intrinsics
from pipeline.labels import Label
from pipeline.transforms import from_rotation, inverse
from sarsim.sensors.rendering import Renderer, fixed_camera

# MuJoCo's camera looks along -z with y up, camera_optical along z with y down.
_MUJOCO_OPTICAL = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True, eq=False)
class LabelledImage:
    """An RGB-D image with true labels, from one pose of the camera.

    Attributes:
        rgb: (H, W, 3) uint8 colours.
        depth: (H, W) float32 m, depth along the optical axis; 0 = no return.
        label: (H, W) uint8 true label of the surface whose depth was measured; 0 = no surface or unlabelled.
        instance: (H, W) int32 geom id of that surface; -1 = no surface.
        intrinsics: intrinsics of all four images.
        T_world_camera: pose of ``camera_optical`` in the world.
        T_base_camera: pose of ``camera_optical`` in the root body of the robot that carries the camera.
    """

    rgb: Rgb
    depth: Depth
    label: NDArray[np.uint8]
    instance: NDArray[np.int32]
    intrinsics: Intrinsics
    T_world_camera: Pose
    T_base_camera: Pose

    def frame(self, time: float, T_odom_base: Pose) -> Frame:
        """The image and its labels as a frame of the robot's software, at ``time`` s with a 4×4 odometry pose."""
        return Frame(
            time=time,
            rgb=self.rgb,
            depth=self.depth,
            intrinsics=self.intrinsics,
            T_base_camera=self.T_base_camera,
            T_odom_base=T_odom_base,
            label=self.label,
            instance=self.instance,
        )


class RgbdCamera:
    """A camera of a model, whose images a renderer draws.

    The robot that carries the camera (all bodies under the same root) gives no return and has no label.
    """

    def __init__(self, renderer: Renderer, camera: int | str) -> None:
        """``camera``: id or name in the renderer's model.

        Raises:
            InputError: the camera does not exist, or a geom's label is not in :class:`pipeline.labels.Label`.
        """
        model = renderer.model
        self.camera_id = fixed_camera(model, camera).fixedcamid
        self.base_body = int(model.body_rootid[model.cam_bodyid[self.camera_id]])
        self.intrinsics = camera_intrinsics(model, self.camera_id, renderer.width, renderer.height)
        self._renderer = renderer
        # A camera that is fixed to the world sees all geoms.
        other = (model.body_rootid[model.geom_bodyid] != self.base_body) | (self.base_body == 0)
        # Indexed by geom id; the last element belongs to id -1, no geom.
        self._label = np.append(np.where(other, geom_labels(model), np.uint8(0)), np.uint8(Label.UNLABELLED))
        self._instance = np.append(np.where(other, np.arange(model.ngeom), -1), -1).astype(np.int32)

    def capture(self, data: mujoco.MjData) -> LabelledImage:
        """The image without noise and without a range limit."""
        geom, depth = self._renderer.segmentation_and_depth(data, self.camera_id)
        instance = self._instance.take(geom)
        return LabelledImage(
            rgb=self._renderer.colour(data, self.camera_id),
            depth=depth * (instance >= 0),
            label=self._label.take(geom),
            instance=instance,
            intrinsics=self.intrinsics,
            T_world_camera=self.pose(data),
            T_base_camera=self.pose_in_base(data),
        )

    def pose(self, data: mujoco.MjData) -> Pose:
        """Pose of ``camera_optical`` in the world."""
        return optical_pose(data, self.camera_id)

    def pose_in_base(self, data: mujoco.MjData) -> Pose:
        """Pose of ``camera_optical`` in the robot's root body; in the world if no robot carries the camera."""
        T_world_base = from_rotation(data.xmat[self.base_body].reshape(3, 3), data.xpos[self.base_body])
        return inverse(T_world_base) @ self.pose(data)


def optical_pose(data: mujoco.MjData, camera_id: int) -> Pose:
    """Pose of a camera's ``camera_optical`` in the world."""
    return from_rotation(data.cam_xmat[camera_id].reshape(3, 3) @ _MUJOCO_OPTICAL, data.cam_xpos[camera_id])


def camera_intrinsics(model: mujoco.MjModel, camera_id: int, width: int, height: int) -> Intrinsics:
    """Intrinsics of a model's camera for images of ``width`` × ``height`` pixels.

    A camera with a ``sensorsize`` has its focal lengths and principal point (an offset from the centre, to the
    left and upwards) in metres on the sensor; any other camera has ``fovy`` and square pixels.
    """
    sensor = model.cam_sensorsize[camera_id]
    if np.all(sensor > 0):
        fx, fy, px, py = model.cam_intrinsic[camera_id] * np.tile([width, height] / sensor, 2)
    else:
        fx = fy = height / 2 / np.tan(np.radians(model.cam_fovy[camera_id]) / 2)
        px = py = 0.0
    return Intrinsics(width, height, float(fx), float(fy), float(width / 2 - px), float(height / 2 - py))


def geom_objects(model: mujoco.MjModel) -> NDArray[np.int32]:
    """The id of the object to which each geom belongs, which is the id of the object's first geom.

    The geoms of a child body of the world and of all bodies nested in it form one object, such as a person, if they
    have the same label. A geom of the world body itself, such as a wall, is an object of its own.

    Returns:
        (ngeom + 1,) int32 object ids; the last one is -1, for pixels without a geom, which have the geom id -1.

    Raises:
        InputError: see :func:`geom_labels`.
    """
    bodies = model.body_rootid[model.geom_bodyid]
    owners = np.where(bodies > 0, bodies, -1 - np.arange(model.ngeom))
    parts = np.column_stack([owners, geom_labels(model)])
    _, first, part = np.unique(parts, axis=0, return_index=True, return_inverse=True)
    return np.append(first[part.ravel()], -1).astype(np.int32)


def geom_labels(model: mujoco.MjModel) -> Labels:
    """(ngeom,) uint8 labels, from the first ``user`` number of each geom; 0 in a model without such numbers.

    Raises:
        InputError: a number is not a label.
    """
    if model.nuser_geom == 0:
        return np.zeros(model.ngeom, np.uint8)
    numbers = model.geom_user[:, 0]
    wrong = np.flatnonzero(~np.isin(numbers, list(Label)))
    if wrong.size:
        geom = model.geom(wrong[0])
        name = geom.name or geom.id
        raise InputError(
            f"geom {name!r} has user={numbers[wrong[0]]:g}, which is not a label;"
            f" labels are integers from 0 to {max(Label):d}"
        )
    return numbers.astype(np.uint8)
