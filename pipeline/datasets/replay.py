"""Replay a recording through the mapper: find the poses of its frames, and choose keyframes."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain, dropwhile, islice
from typing import Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.arrays import Direction, Pose
from pipeline.datasets.camera_pose import find_pose_above_floor
from pipeline.datasets.depth_cameras import measured_by
from pipeline.datasets.images import clip_of
from pipeline.datasets.recording import Recording
from pipeline.errors import InputError, required
from pipeline.frame import Frame
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.depth_odometry import DepthOdometry
from pipeline.localisation.localisation import Localisation
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.localisation.slam import Slam
from pipeline.localisation.trajectory import Trajectory
from pipeline.localisation.vertical import T_lowest_camera, vertical
from pipeline.mapper import Keyframe, Mapper, sense_and_map
from pipeline.transforms import from_rotation, inverse, rotation_from_up

PoseSource = Literal["slam", "registration", "odometry", "truth"]
"""Source of the poses: odometry corrected by registration (``slam``), registration alone, or recorded poses without
correction, which are odometry or true poses."""


MIN_MEDIAN_DEPTH, MAX_MEDIAN_DEPTH = 0.35, 15.0  # m, usual range of the median depth of an image
MAX_OFF_CENTRE = (
    0.12  # Maximum usual distance of a principal point from the middle, as a fraction of the image's size
)
MAX_RELATIVE_WIDTH = 20.0  # Maximum size of an image in focal lengths, which corresponds to a field of view of 169°
CLIP_FRAMES = 10  # Number of frames at the start in which a depth that stands for no return is sought
MAX_AXES_ANGLE = np.radians(1.0)  # Maximum angle between two poses of the camera on the robot that agree
POSELESS = "frames without a known pose"


class Replayed(NamedTuple):
    """A frame that was passed to the mapper.

    Attributes:
        frame: the frame, with its ``T_odom_base`` and ``T_base_camera``.
        keyframe: the keyframe made from the frame; None if none was made.
        T_world_base: the true pose; None if the recording has none.
    """

    frame: Frame
    keyframe: Keyframe | None
    T_world_base: Pose | None


def default_pose_source(recording: Recording) -> PoseSource:
    """The default source of poses: odometry corrected by registration or, without odometry, registration alone."""
    return "registration" if recording.odometry is None else "slam"


def localisation_of(poses: PoseSource, config: LocalisationConfig = LocalisationConfig()) -> Localisation:
    """The mapper's localisation for a source of poses."""
    if poses not in ("slam", "registration"):
        return OdometryLocalisation(config=config)
    # Without odometry, the camera may be hand-held.
    return Slam(on_ground=poses == "slam", config=config)


class Replay:
    """Adds a recording's frames to the maps in order."""

    def __init__(self, recording: Recording, mapper: Mapper, poses: PoseSource, T_base_camera: Pose | None = None):
        """Replay with a source of poses.

        ``T_base_camera`` overrides the recorded pose of the camera. If neither pose is known, the camera's pose above
        the floor is estimated.

        Raises:
            InputError: the recording lacks the poses of this source.
        """
        self.recording, self.mapper, self._config = recording, mapper, mapper.config.localisation
        self._T_base_camera = T_base_camera
        self._is_on_ground = T_base_camera is not None or recording.has_camera_pose
        mapper.knows_camera = self._is_on_ground
        self._given = self._given_poses(poses)
        robot = mapper.elevation_map.robot
        self._max_tilt = robot.max_tilt
        self._truth: Trajectory | None = None
        self._odometry: DepthOdometry | None = None
        self._has_begun = False
        self._track: list[Pose] = []

    def _given_poses(self, poses: PoseSource) -> Trajectory | None:
        given = {"registration": None, "truth": self.recording.truth}.get(poses, self.recording.odometry)
        if given is None and poses != "registration":
            what = "true poses" if poses == "truth" else "odometry"
            needed = f"--poses {poses} needs {what}, but the recording has none"
            raise InputError(f"{self.recording.path}: {needed}; use --poses registration")
        return given

    def __iter__(self) -> Iterator[Replayed]:
        """Add the frames to the maps in order.

        Raises:
            InputError: the recording is broken; all frames before the broken one have been mapped.
            LostError: the pose of a frame cannot be found; all frames before this frame have been mapped.
        """
        for frame in self._frames():
            if not self._has_begun and not self._begin(self.mapper.clean(frame)):
                continue
            if self._T_base_camera is not None:
                frame = replace(frame, T_base_camera=self._T_base_camera)
            T = self._T_odom_base(frame)
            if T is None:
                self.recording.leave_out(POSELESS)
                continue
            frame = replace(frame, T_odom_base=T)
            truth = self._truth.at(frame.time, self._config.trajectory) if self._truth else None
            yield Replayed(frame, self._make_keyframe_if_due(frame), truth)

    def _frames(self) -> Iterator[Frame]:
        """The recording's frames, with depths that are out of range or stand for no return set to 0."""
        frames, first, broken = self.recording.frames(), list[Frame](), None
        try:
            first.extend(islice(frames, CLIP_FRAMES))
        except InputError as error:
            broken = error
        clip = clip_of([frame.depth for frame in first])
        if clip is not None:
            self.recording.note(f"a depth of exactly {clip:g} m, which many pixels have, is taken for no return")
        for frame in chain(first, frames):
            if clip is not None:
                frame = replace(frame, depth=np.where(frame.depth < np.float32(clip), frame.depth, np.float32(0)))
            yield frame if self.recording.sensor is None else measured_by(self.recording.sensor, frame)
        if broken:
            raise broken

    def _T_odom_base(self, frame: Frame) -> Pose | None:
        if self._odometry is not None:
            return self._odometry.pose(self.mapper.clean(frame))
        return self._given.at(frame.time, self._config.trajectory) if self._given else None

    def _begin(self, frame: Frame) -> bool:
        """Find the poses of camera and robot from the first frame; False if it is blank or its pose is unknown."""
        if not frame.returns.any():
            self.recording.leave_out("blank frames at the start")
            return False
        if self._given is not None and self._given.at(frame.time, self._config.trajectory) is None:
            self.recording.leave_out(POSELESS)
            return False
        self._has_begun = True
        self._check_camera(frame)
        if not self._is_on_ground:
            self._T_base_camera = self._pose_above_floor(frame)
            self.recording.note(_estimate_note(self._T_base_camera))
        T_base_camera = frame.T_base_camera if self._T_base_camera is None else self._T_base_camera
        up = self._up(frame, T_base_camera) if self._is_on_ground else np.array([0.0, 0.0, 1.0])
        T_map_base = from_rotation(rotation_from_up(up / np.linalg.norm(up)), np.zeros(3))
        if self._given is None:
            self._odometry = DepthOdometry(T_map_base, config=self._config)
        else:
            self._given = self._upright(self._given.of_base(T_base_camera), up, T_map_base, frame.time)
        truth = self.recording.truth
        self._truth = truth and truth.of_base(T_base_camera)
        return True

    def _check_camera(self, frame: Frame) -> None:
        """Note implausible depth and intrinsics of a frame; InputError if they are unusable."""
        k, depth = frame.intrinsics, float(np.median(frame.depth[frame.returns]))
        usual = "of metres (floats) or mm (whole numbers); give the units per metre with --depth-scale"
        said = f"the median depth is {depth:.3g} m; depth images must be {usual}"
        if not MIN_MEDIAN_DEPTH / 10 < depth < 10 * MAX_MEDIAN_DEPTH:
            raise InputError(f"{self.recording.path}: {said}")
        if not MIN_MEDIAN_DEPTH < depth < MAX_MEDIAN_DEPTH:
            self.recording.note(said)
        off = max(abs(k.cx / k.width - 0.5), abs(k.cy / k.height - 0.5))
        wide = max(k.width / k.fx, k.height / k.fy)
        camera = f"fx fy cx cy = {k.fx:.4g} {k.fy:.4g} {k.cx - 0.5:.4g} {k.cy - 0.5:.4g}"
        doubt = f"{camera} do not look like intrinsics of images of {k.width} × {k.height} pixels"
        if off > 0.5 or wide > MAX_RELATIVE_WIDTH:
            raise InputError(f"{self.recording.path}: {doubt}; give those of this size with --intrinsics")
        if off > MAX_OFF_CENTRE:
            self.recording.note(f"{doubt}, as the principal point is far from the middle")

    def _upright(self, given: Trajectory, up: Direction, T_map_base: Pose, time: float) -> Trajectory:
        """The given poses, transformed to ``map`` if the z axis of their frame does not point upwards.

        The z axis points upwards if its angle to the vertical is at most the robot's maximum tilt.

        Args:
            given: poses of ``base_link``, in any frame.
            up: the vertical in ``base_link`` at ``time``, s.
            T_map_base: pose at ``time`` in a ``map`` whose origin is at this position.
        """
        T = required(given.at(time, self._config.trajectory))
        if T[2, :3] @ up >= np.cos(self._max_tilt) * np.linalg.norm(up):
            return given
        return given.moved(T_map_base @ inverse(T))

    def _pose_above_floor(self, first: Frame) -> Pose:
        """Pose of the first frame's camera above the floor, from the accelerometer or else the surfaces in view.

        Raises:
            InputError: neither determines the vertical.
        """
        if self.recording.up is not None:
            return T_lowest_camera(first, self.recording.up)
        left_out = dict(self.recording.left_out)
        frames = (self.mapper.clean(f) for f in dropwhile(lambda f: f.time < first.time, self._frames()))
        mounted = find_pose_above_floor(frames, self._camera_pose_function(), self._config)
        self.recording.left_out = left_out  # These frames are counted when they are mapped
        if mounted is not None:
            if mounted.other is not None:
                doubt = "two surfaces in view may be the floor; if it is the other, the camera is"
                self.recording.note(f"{doubt} {_described(mounted.other)}; to set it, use --camera-pose")
            return mounted.T_level_camera
        unknown = "neither an accelerometer nor a view of floor and walls determines the vertical"
        raise InputError(f"{self.recording.path}: {unknown}; give the camera's pose with --camera-pose")

    def _camera_pose_function(self) -> Callable[[Frame], Pose | None]:
        """A function that returns the pose of a frame's camera, from given poses or else from registration."""
        given = self._given
        if given is None or not given.of_camera:
            return DepthOdometry(np.eye(4), config=self._config).pose
        return lambda frame: given.at(frame.time, self._config.trajectory)

    def _up_by_accelerometer(self, frame: Frame, T_base_camera: Pose) -> Direction | None:
        """The vertical in ``base_link`` from the accelerometer; None without one, or if its axes are in doubt."""
        up = self.recording.up
        if up is None or not self.recording.has_camera_pose:
            return None if up is None else T_base_camera[:3, :3] @ up
        turned = Rotation.from_matrix(frame.T_base_camera[:3, :3].T @ T_base_camera[:3, :3]).magnitude()
        if turned < MAX_AXES_ANGLE:
            return up
        doubt = "it may be mounted on the camera, whose recorded pose is turned otherwise than the given one"
        self.recording.note(f"ignoring the accelerometer: {doubt}")
        return None

    def _up(self, frame: Frame, T_base_camera: Pose) -> Direction:
        """The vertical in ``base_link``: from the accelerometer, else from the surfaces in view, else the z axis."""
        felt = self._up_by_accelerometer(frame, T_base_camera)
        if felt is not None:
            return felt
        up = vertical(replace(frame, T_base_camera=T_base_camera), self._config)
        return np.array([0.0, 0.0, 1.0]) if up is None else up

    def _make_keyframe_if_due(self, frame: Frame) -> Keyframe | None:
        """Make a keyframe of the frame if a keyframe is due; return the keyframe, or None if none was made."""
        self._track.append(frame.T_odom_base)
        labelled = self._is_labelled(frame)
        if labelled is None:
            return None
        recorded = self.recording.keyframes is not None
        at_stop = frame.time in self.recording.steps if recorded else labelled
        if at_stop:
            self._add_track()
            self.mapper.apply_corrections(only_if_due=True)
        keyframe = sense_and_map(self.mapper, lambda: frame, labelled=labelled, may_repeat=recorded)
        if keyframe is not None and at_stop:
            self.mapper.update_topological_map(keyframe)
        return keyframe

    def _is_labelled(self, frame: Frame) -> bool | None:
        """Whether the keyframe to be made of a frame is to be labelled; None if no keyframe is due."""
        if self.recording.keyframes is not None:
            return self.recording.keyframes.get(frame.time)
        if not self.mapper.is_due(frame.T_odom_base):
            return None
        return self.mapper.is_label_due

    def _add_track(self) -> None:
        """Add the driven track to the maps, as an explorer does after each drive."""
        if self._is_on_ground and len(self.mapper.keyframes):
            poses = self.mapper.T_map_odom @ np.reshape(self._track, (-1, 4, 4))
            track = np.column_stack([poses[:, :2, 3], np.arctan2(poses[:, 1, 0], poses[:, 0, 0])])
            self.mapper.add_drive(track, np.zeros((0, 3), np.float32), [])
        self._track.clear()


def _estimate_note(T_base_camera: Pose) -> str:
    """A note which states that the camera's pose on the robot was estimated."""
    pose = _described(T_base_camera)
    return f"the recording lacks the camera's pose; using an estimate ({pose}); to set it, use --camera-pose"


def _described(T_base_camera: Pose) -> str:
    height, down = T_base_camera[2, 3], np.degrees(np.arcsin(np.clip(-T_base_camera[2, 2], -1, 1)))
    return f"{height:.2f} m high, tilted {'down' if down >= 0 else 'up'} by {abs(down):.0f}°"
