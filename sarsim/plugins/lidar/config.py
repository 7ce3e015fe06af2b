"""Settings of the lidar, with presets of sensors on the market."""

import math
import re
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
import tyro
from tyro.conf import Fixed

from pipeline.arrays import Values
from pipeline.errors import InputError
from sarsim.flags import Given

MAX_BEAMS = 2**20
"""Maximum number of beams in a scan; the densest sensor on the market has a quarter of this number."""
MIN_ROW_SPACING = 1e-3
"""Minimum difference between the elevations of two rows, degrees; the finest sensors on the market have 0.01°."""


@dataclass(frozen=True)
class LidarModel:
    """A lidar that turns about its z axis: rows of beams at fixed elevations, fired column by column.

    Attributes:
        elevations: elevation of each row, degrees above the horizontal.
        columns: number of columns in the field of view.
        field_of_view: horizontal field of view, degrees, centred on the x axis; columns run counter-clockwise.
        range: nearest and farthest distance that is reported, m.
        rate: turns per second.
        sigma: standard deviation of a range at distance 0 and at the farthest distance, m, at normal incidence.
        detection_range: distance, m, from which a beam returns with ``detection_probability`` at normal incidence.
        detection_probability: fraction of the beams that returns from ``detection_range``.
    """

    elevations: tuple[float, ...]
    columns: int
    field_of_view: float
    range: tuple[float, float]
    rate: float
    sigma: tuple[float, float]
    detection_range: float
    detection_probability: float = 0.9

    def __post_init__(self) -> None:
        """Raise InputError for values that no lidar has."""
        rows, columns, view = len(self.elevations), self.columns, self.field_of_view
        if rows < 1 or columns < 1:
            raise InputError(f"--lidar {rows}x{columns}: a lidar needs at least one row and one column of beams")
        if rows * columns > MAX_BEAMS:
            raise InputError(f"--lidar {rows}x{columns}: a scan may have at most {MAX_BEAMS} beams")
        if not all(abs(angle) < 90 for angle in self.elevations):
            raise InputError(f"--lidar-vertical {_words(self.elevations)}: elevations must be between -90° and 90°")
        if np.diff(np.sort(np.array(self.elevations, np.float64))).min(initial=np.inf) < MIN_ROW_SPACING:
            text = f"--lidar-vertical {_words(self.elevations)}: rows overlap; give every row an angle of its own"
            raise InputError(text)
        if not 0 < view <= 360:
            raise InputError(
                f"--lidar-horizontal {view:g}: columns overlap beyond 360°; give more than 0 and at most 360"
            )
        nearest, farthest = self.range
        if not 0 < nearest < farthest < math.inf:
            raise InputError(f"--lidar-range {nearest:g} {farthest:g}: must be above 0, finite, the nearer one first")
        if not 0 < self.rate <= 1000:
            raise InputError(f"--lidar-rate {self.rate:g}: must be above 0 and at most 1000 turns a second")
        if not all(0 <= value < math.inf for value in self.sigma):
            raise InputError(f"lidar.sigma {_words(self.sigma)}: standard deviations must be finite and at least 0 m")
        if not (self.detection_range > 0 and 0 < self.detection_probability <= 1):
            raise InputError(
                f"lidar.detection_range {self.detection_range:g}, lidar.detection_probability"
                f" {self.detection_probability:g}: the range must be above 0 m, and the probability above 0 and at"
                " most 1"
            )

    @property
    def azimuths(self) -> Values:
        """(columns,) azimuth of each column from the x axis, rad, counter-clockwise."""
        half = math.radians(self.field_of_view) / 2
        return (
            np.linspace(-half, half, self.columns, endpoint=self.field_of_view < 360)
            if self.columns > 1
            else np.zeros(1)
        )

    @property
    def column_time(self) -> float:
        """Time from one column to the next, s."""
        step = float(self.azimuths[1] - self.azimuths[0]) if self.columns > 1 else 2 * math.pi
        return step / (2 * math.pi * self.rate)


def spaced_elevations(rows: int, lowest: float, highest: float) -> tuple[float, ...]:
    """(rows,) evenly spaced elevations, degrees; a single row lies in the middle."""
    return tuple(np.linspace(lowest, highest, rows).tolist()) if rows != 1 else ((lowest + highest) / 2,)


PRESETS = {
    "vlp-16": LidarModel(spaced_elevations(16, -15, 15), 1800, 360, (0.4, 100), 10, (0.03, 0.03), 100),
    "os1-64": LidarModel(spaced_elevations(64, -16.6, 16.6), 1024, 360, (0.8, 120), 10, (0.015, 0.1), 40),
    "utm-30lx": LidarModel((0.0,), 1081, 270, (0.1, 30), 40, (0.01, 0.03), 30),
}
"""Sensors by name, from their data sheets.

- Velodyne VLP-16 (63-9243 Rev. D, 63-9229): 16 rows, ±15°, 5 to 20 turns a second with columns 0.1° to 0.4° apart, up
  to 100 m. The "typical accuracy ±3 cm" is taken as the standard deviation at all distances. The nearest distance is
  the default of Velodyne's ROS driver.
- Ouster OS1-64 (first generation): 64 rows, ±16.6°, 1024 columns at 10 turns a second, 0.8 to 120 m; repeatability
  1.5 cm with a strong signal and 10 cm with the weakest one; 40 m on surfaces that reflect 10%.
- Hokuyo UTM-30LX: one row of 1081 beams over 270°, 25 ms a scan, 0.1 to 30 m; repeatability 1 cm up to
  10 m and 3 cm up to 30 m.
"""
BASE_PRESET = PRESETS["vlp-16"]
"""Preset that supplies the other properties of a lidar that is given as ROWSxCOLUMNS."""


@dataclass(frozen=True)
class LidarConfig:
    """The lidar that the robot carries; a setting that is None takes the sensor's value.

    Attributes:
        sensor: vlp-16, os1-64, utm-30lx, or rows and columns of beams, such as 16x900.
        range: nearest and farthest distance that is measured, m.
        vertical: elevation of the lowest and the highest row, or of every row, degrees.
        horizontal: horizontal field of view, degrees.
        rate: turns per second. A simulated robot gives at most one scan per control period, 25 a second.
        rolling: measure each column at the robot's pose at the column's time, not at the pose where the scan begins.
        noise: simulate noise of the ranges, and beams without return.
        sigma: standard deviation of a range at distance 0 and at the farthest distance, m; by default, that of the
            sensor at these distances.
        detection_range: distance, m, from which a beam returns with ``detection_probability``.
        detection_probability: fraction of the beams that returns from ``detection_range``.
    """

    sensor: Annotated[str, tyro.conf.Positional] = "vlp-16"
    range: Given[tuple[float, float]] = None
    vertical: Given[tuple[float, ...]] = None
    horizontal: Given[float] = None
    rate: Given[float] = None
    rolling: bool = False
    noise: bool = True
    sigma: Fixed[tuple[float, float] | None] = None
    detection_range: Fixed[float | None] = None
    detection_probability: Fixed[float | None] = None

    def __post_init__(self) -> None:
        """Raise InputError if there is no such lidar."""
        self.model()

    def model(self) -> LidarModel:
        """The sensor with these settings; InputError if there is no such sensor."""
        model = PRESETS.get(self.sensor)
        if model is None:
            rows, columns = self._size()
            elevations = (
                spaced_elevations(rows, BASE_PRESET.elevations[0], BASE_PRESET.elevations[-1])
                if rows <= MAX_BEAMS
                else (0.0,) * rows
            )
            model = replace(BASE_PRESET, elevations=elevations, columns=columns)
        near, far = model.sigma
        noise = self.sigma
        if self.range is not None and noise is None:  # another range does not change the noise at a distance
            noise = near, near + (far - near) * self.range[1] / model.range[1]
        given: dict[str, Any] = {
            "range": self.range,
            "field_of_view": self.horizontal,
            "elevations": self._elevations(len(model.elevations)),
            "rate": self.rate,
            "sigma": noise,
            "detection_range": self.detection_range,
            "detection_probability": self.detection_probability,
        }
        return replace(model, **{name: value for name, value in given.items() if value is not None})

    def _size(self) -> tuple[int, int]:
        if not (found := re.fullmatch(r"(\d{1,7})x(\d{1,7})", self.sensor)):
            known = ", ".join(PRESETS)
            raise InputError(f"--lidar {self.sensor}: must be {known}, or rows and columns of beams, such as 16x900")
        rows, columns = map(int, found.groups())
        if rows * columns > MAX_BEAMS:
            raise InputError(f"--lidar {self.sensor}: a scan may have at most {MAX_BEAMS} beams")
        return rows, columns

    def _elevations(self, rows: int) -> tuple[float, ...] | None:
        angles = self.vertical
        if angles is None or len(angles) == rows:
            return angles
        if len(angles) != 2:
            raise InputError(
                f"--lidar-vertical {_words(angles)}: give two angles, the lowest and the highest, or one for each of"
                f" the {rows} rows"
            )
        return spaced_elevations(rows, *angles)


def _words(values: tuple[float, ...]) -> str:
    """Numbers as on a command line, shortened."""
    return " ".join(f"{value:g}" for value in values[:6]) + (" …" if len(values) > 6 else "")
