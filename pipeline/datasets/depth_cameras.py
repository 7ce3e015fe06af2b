"""Range and noise of common depth cameras, which are recognised by the names in a recording."""

import re
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.sensor import STRUCTURED_LIGHT, DepthNoise, SensorModel

FARTHEST = 8.0  # m: the maps keep points up to 8.19 m away from the robot along each axis
MAX_NOISE = 0.1  # m, maximum standard deviation of depth at 1 m, six times the value of the noisiest camera below
DISPARITY_NOISE = 0.08
"""Noise of a RealSense's disparity on a textured surface, pixels (Intel's guide to tuning the D400)."""


class KnownCamera(NamedTuple):
    """A depth camera that is identified by names in a recording.

    Attributes:
        name: name of the camera with its article, as in a sentence.
        pattern: matches the names of files, topics and frames that identify the camera.
        sensor: range and noise of the camera.
    """

    name: str
    pattern: re.Pattern[str]
    sensor: SensorModel


def stereo_noise(focal_length: float, baseline: float, subpixel: float = DISPARITY_NOISE) -> DepthNoise:
    """The noise of a stereo camera, whose standard deviation is ``depth² · subpixel / (focal length · baseline)``.

    Args:
        focal_length, subpixel: focal length, and standard deviation of the disparity, pixels.
        baseline: distance between the two cameras, m.
    """
    return DepthNoise(0.0, subpixel / (focal_length * baseline))


def _camera(name: str, pattern: str, nearest: float, farthest: float, noise: DepthNoise) -> KnownCamera:
    return KnownCamera(name, re.compile(pattern, re.IGNORECASE), SensorModel.with_range(nearest, farthest, noise))


# Ranges of stereo cameras end where the noise reaches 5 cm, half a voxel; focal lengths are for 848 × 480 pixels.
KNOWN_CAMERAS = (
    # Range: Microsoft. Noise, for surfaces seen head-on: Fankhauser et al., ICAR 2015.
    _camera("a Kinect v2", r"kinect[-_]?(2|v2|one)|\bk4w2\b", 0.5, 4.5, DepthNoise(0.00129, 0.0003, 0.83)),
    # Range and noise in the narrow mode, binned: Microsoft's hardware specification.
    _camera("an Azure Kinect", r"azure[-_]?kinect|k4a|femto", 0.5, 5.46, DepthNoise(0.017, 0.0)),
    # Nearest depths, fields of view and baselines of RealSense cameras: Intel's data sheet of the D400 family.
    _camera("a RealSense D455", r"(?<![a-z])d45[0-9]", 0.5, 5.1, stereo_noise(447, 0.095)),
    _camera("a RealSense D415", r"(?<![a-z])d41[0-9]", 0.3, 4.8, stereo_noise(665, 0.055)),
    _camera(
        "a RealSense D435", r"(?<![a-z])d43[0-9]|realsense|/device_\d+/sensor_", 0.2, 3.6, stereo_noise(424, 0.05)
    ),
    # Range: Khoshelham & Elberink, Sensors 2012. All these cameras have the same chip or a copy of it.
    _camera(
        "a Kinect or Xtion", r"kinect|xtion|primesense|openni|astra|freiburg[123]", *(0.5, 5.0, STRUCTURED_LIGHT)
    ),
)
"""Known cameras. The first camera whose pattern matches a name is used; an unspecified RealSense matches the D435."""
DEFAULT_SENSOR = SensorModel.with_range(0.5, 5.0, STRUCTURED_LIGHT)
"""Sensor model that is used if a recording does not name its camera."""


def camera_named(names: Iterable[str]) -> tuple[KnownCamera, str] | None:
    """The first known camera whose pattern matches one of the names, and that name; None if there is no match."""
    words = list(names)
    return next(((camera, word) for camera in KNOWN_CAMERAS for word in words if camera.pattern.search(word)), None)


def measured_by(sensor: SensorModel, frame: Frame) -> Frame:
    """A frame with the sensor model of its camera, and without returns outside the camera's range.

    The maps use the whole range; the frame's sensor model ends where depth is too imprecise for registration.
    """
    return replace(frame, depth=sensor.in_range(frame.depth), sensor=sensor.precise)


def with_overrides(
    sensor: SensorModel,
    depth_range: tuple[float, float] | None = None,
    depth_noise: float | None = None,
    names: tuple[str, str] = ("--depth-range", "--depth-noise"),
) -> SensorModel:
    """A sensor model whose range and noise are replaced by those that the user has given, if any.

    Args:
        sensor: sensor model that provides the values that the user has not given.
        depth_range: nearest and farthest depth, m.
        depth_noise: standard deviation at a depth of 1 m, m; it grows with the square of depth.
        names: names of the two flags or settings, for error messages.

    Raises:
        InputError: a value is out of bounds, or the range is too short for the noise.
    """
    if depth_range is None and depth_noise is None:
        return sensor
    nearest, farthest = depth_range or (sensor.nearest, sensor.farthest)
    if not 0 < nearest < farthest <= FARTHEST:
        rule = f"must be above 0 and at most {FARTHEST:g} m, the nearer one first"
        raise InputError(f"{names[0]} {nearest:g} {farthest:g}: {rule}")
    if depth_noise is not None and not 0 < depth_noise <= MAX_NOISE:
        raise InputError(f"{names[1]} {depth_noise:g}: must be above 0 and at most {MAX_NOISE:g} m at 1 m")
    noise = sensor.noise if depth_noise is None else DepthNoise(0.0, depth_noise)
    given = SensorModel.with_range(nearest, farthest, noise)
    if not nearest + given.margin < farthest - given.margin:
        found = f"depths from {nearest:g} to {farthest:g} m, with a noise of {given.sigma(farthest):.2g} m at the end"
        raise InputError(f"{found}: too short or too noisy; correct {names[0]} or {names[1]}")
    return given
