"""A lidar in a MuJoCo model: ranges by casting rays, with the true label and instance of every beam."""

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from pipeline.arrays import Directions, Labels, Mask, Points, Pose, Poses, Values
from pipeline.transforms import from_rotation, inverse
from sarsim.ground_truth.meshes import DRAWN_GROUPS
from sarsim.plugins.lidar.config import LidarModel
from sarsim.sensors.camera import geom_labels, optical_pose
from sarsim.sensors.rendering import hidden

SITE = "lidar"
"""Name of the site in a robot's MJCF at which the lidar is mounted."""
ABOVE_CAMERA = 0.06
"""m, height of the lidar above the camera on a robot without such a site: level, on top of the mast."""
MIN_COSINE = np.cos(np.radians(80))
"""Cosine of the incidence angle beyond which noise grows no further; Soudarissanane et al. measured up to 80°."""
NOTHING = -1  # geom id of a beam that hits nothing
TIME_TOLERANCE = 1e-9  # s, tolerance for rounding errors of times that are sums of control periods


@dataclass(frozen=True, eq=False)
class Scan:
    """The returns of a lidar in one turn, row by row if it does not roll.

    Attributes:
        start: time of the first column, s.
        T_world_lidar: 4×4 pose of ``lidar`` at that time.
        points: (N, 3) m in ``lidar`` at the time when each point was measured.
        range: (N,) float32 measured distance, m.
        ring: (N,) uint16 row of the beam, from the first of the model's elevations.
        column: (N,) int32 column of the beam, in the order in which a turn measures them.
        time: (N,) float32 s since ``start``; 0 if the scan does not roll.
        normal: (N, 3) float32 true unit normal of the surface in ``lidar``, towards the sensor.
        label: (N,) true label of the surface.
        instance: (N,) int32 geom id of the surface.
    """

    start: float
    T_world_lidar: Pose
    points: Points
    range: NDArray[np.float32]
    ring: NDArray[np.uint16]
    column: NDArray[np.int32]
    time: NDArray[np.float32]
    normal: NDArray[np.float32]
    label: Labels
    instance: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.range)

    @property
    def intensity(self) -> NDArray[np.float32]:
        """(N,) fraction of the light that a matt white surface sends back: the cosine of the incidence angle."""
        along = np.einsum("ij,ij->i", self.points, self.normal)
        return np.clip(-along / np.maximum(self.range, np.float32(1e-6)), 0, 1).astype(np.float32)


class Scanner:
    """A lidar that a robot carries; the robot's own geoms are left out, as if they were transparent.

    Attributes:
        model: the sensor.
        rolls: whether each column is measured at the robot's pose at the column's time.
    """

    def __init__(
        self,
        world: mujoco.MjModel,
        data: mujoco.MjData,
        base_body: int,
        model: LidarModel,
        rng: np.random.Generator | None = None,
        rolls: bool = False,
    ):
        """Mount the sensor at the robot's site ``lidar``, or else above its camera.

        Args:
            world: MuJoCo model of the arena and the robot.
            data: the model's state, which the scanner reads at every scan.
            base_body: id of the robot's body ``base_link``, or of its root at the same pose.
            model: the sensor.
            rng: draws the sensor's errors; None for a sensor without errors.
            rolls: whether each column is measured at the robot's pose at the column's time.

        Raises:
            InputError: a geom's label is invalid.
        """
        self.model, self.rolls = model, rolls
        self._world, self._data, self._base, self._rng = world, data, base_body, rng
        root = world.body_rootid[base_body]
        self._is_robot: Mask = world.body_rootid[world.geom_bodyid] == root
        self._groups = np.isin(np.arange(mujoco.mjNGROUP), DRAWN_GROUPS).astype(np.uint8)
        self._label = geom_labels(world)
        self._site = _robot_site(world, root)
        self._T_base_lidar = self._mount(root)
        up, around = np.meshgrid(np.radians(model.elevations), model.azimuths, indexing="ij")
        self._rays = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=-1)
        self._start_time, self._turn, self._fired = 0.0, 0, 0
        self._before: tuple[float, Pose] | None = None
        self._parts: list[Scan] = []

    @property
    def pose(self) -> Pose:
        """Current ``T_world_lidar``."""
        return self._T_world_base @ self.T_base_lidar

    @property
    def T_base_lidar(self) -> Pose:
        """Current pose of ``lidar`` in ``base_link``."""
        if self._site is None:
            return self._T_base_lidar
        site, data = self._site, self._data
        return inverse(self._T_world_base) @ from_rotation(data.site_xmat[site].reshape(3, 3), data.site_xpos[site])

    @property
    def _T_world_base(self) -> Pose:
        return from_rotation(self._data.xmat[self._base].reshape(3, 3), self._data.xpos[self._base])

    def _mount(self, root: int) -> Pose:
        """4×4 pose of ``lidar`` in ``base_link``: level, above the robot's first camera or else above the origin."""
        carried = np.flatnonzero(self._world.body_rootid[self._world.cam_bodyid] == root)
        camera = optical_pose(self._data, int(carried[0])) if len(carried) else self._T_world_base
        place = (inverse(self._T_world_base) @ camera)[:3, 3]
        return from_rotation(np.eye(3), place + np.array([0, 0, ABOVE_CAMERA]))

    def scan(self, time: float) -> Scan:
        """A scan whose beams are all measured at the current pose; ``time``, s, is recorded as its start."""
        with hidden(self._world, self._is_robot):
            return self._measure(time, self.pose, self._rays, np.arange(self.model.columns), None)

    def advance(self, time: float) -> list[Scan]:
        """Advance to ``time``, s, and return the scans completed since the last call; to be called after each motion.

        The first call begins the first turn. A lidar that does not roll measures a whole scan at the first call after
        the beginning of a turn; if several turns have passed, it measures only the last.
        """
        pose = self.pose
        before, self._before = self._before, (time, pose)
        if before is None:
            self._start_time = time
            return [] if self.rolls else [self._next_scan(time)]
        if self.rolls:
            with hidden(self._world, self._is_robot):
                return list(self._scan_rolling(*before, time, pose))
        return (
            [self._next_scan(time)]
            if time >= self._start_time + self._turn / self.model.rate - TIME_TOLERANCE
            else []
        )

    def _next_scan(self, time: float) -> Scan:
        self._turn = int((time - self._start_time) * self.model.rate + TIME_TOLERANCE) + 1
        return self.scan(time)

    def _scan_rolling(self, t0: float, T0: Pose, t1: float, T1: Pose) -> Iterator[Scan]:
        """Fire the columns between two times, s, as the robot moves between two poses, and yield complete scans."""
        step, columns = self.model.column_time, self.model.columns
        while True:
            start = self._start_time + self._turn / self.model.rate
            due = int(np.clip(np.ceil((t1 - start - TIME_TOLERANCE) / step), self._fired, columns))
            if due > self._fired:
                fired = np.arange(self._fired, due)
                poses = _interpolated_poses(t0, T0, t1, T1, start + fired * step)
                T_start = self._parts[0].T_world_lidar if self._parts else poses[0]
                self._parts.append(self._measure(start, T_start, self._rays[:, fired], fired, poses))
                self._fired = due
            if self._fired < columns:
                return
            yield _joined(self._parts)
            self._turn, self._fired, self._parts = self._turn + 1, 0, []

    def _measure(
        self, start: float, T_start: Pose, rays: NDArray[np.float64], columns: NDArray[np.int64], poses: Poses | None
    ) -> Scan:
        """The returns of (R, C, 3) rays of (C,) columns, cast from ``T_start``, or from one pose for each column."""
        count = len(columns)
        if poses is None:
            geom, distance, normal = self._cast(T_start, rays.reshape(-1, 3))
            times = np.zeros(count, np.float32)
        else:
            geom, distance, normal = self._cast_columns(poses, rays)
            times = (columns * self.model.column_time).astype(np.float32)
        rays = rays.reshape(-1, 3)
        cosine = np.abs(np.einsum("ij,ij->i", rays, normal))
        measured, returns = self._add_errors(distance, cosine)
        nearest, farthest = self.model.range
        chosen = np.flatnonzero((geom != NOTHING) & returns & (measured >= nearest) & (measured <= farthest))
        row, column = np.divmod(chosen, count)
        rays, normal, geom, measured = rays[chosen], normal[chosen], geom[chosen], measured[chosen]
        normal *= -np.sign(np.einsum("ij,ij->i", rays, normal))[:, None]
        return Scan(
            start=start,
            T_world_lidar=T_start,
            points=(rays * measured[:, None]).astype(np.float32),
            range=measured.astype(np.float32),
            ring=row.astype(np.uint16),
            column=columns[column].astype(np.int32),
            time=times[column],
            normal=normal.astype(np.float32),
            label=self._label[geom],
            instance=geom,
        )

    def _cast_columns(
        self, poses: Poses, rays: NDArray[np.float64]
    ) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]:
        """As :meth:`_cast`, row by row, for (R, C, 3) rays, each of whose columns has its own pose."""
        rows = rays.shape[0]
        cast = [self._cast(T, rays[:, k]) for k, T in enumerate(poses)]
        geom = np.stack([geoms for geoms, _, _ in cast], axis=1).ravel()
        distance = np.stack([distances for _, distances, _ in cast], axis=1).ravel()
        return geom, distance, np.stack([normals for _, _, normals in cast], axis=1).reshape(rows * len(poses), 3)

    def _cast(
        self, T_world_lidar: Pose, rays: Directions
    ) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]:
        """Geom id, distance in m and unit normal in ``lidar`` of the surfaces that (N, 3) rays in ``lidar`` hit.

        The id is ``NOTHING`` if a ray hits no surface.
        """
        count, R = len(rays), T_world_lidar[:3, :3]
        geom, distance, normal = np.empty(count, np.int32), np.empty(count), np.empty((count, 3))
        mujoco.mj_multiRay(
            self._world,
            self._data,
            T_world_lidar[:3, 3].copy(),
            (rays @ R.T).ravel(),
            self._groups,
            True,  # geoms of the world too
            -1,  # no body is excluded, because the robot has several bodies and its geoms are hidden
            geom,
            distance,
            normal.reshape(-1),
            count,
            self.model.range[1],
        )
        return geom, distance, normal @ R

    def _add_errors(self, distance: Values, cosine: Values) -> tuple[Values, Mask]:
        """(N,) measured distances, m, and whether each of the (N,) beams returns.

        They are drawn from the true distances, m, and the cosines of the incidence angles, both (N,).

        The standard deviation grows linearly with the distance, between the values of the data sheet. It also grows
        with the inverse cosine of the incidence angle, because the signal gets weaker (Soudarissanane et al.,
        "Incidence angle influence on the quality of terrestrial laser scanning points", Laser Scanning 2009). The
        signal of a matt surface is proportional to the cosine, and inversely proportional to the square of the
        distance. Speckle distributes the signal exponentially (Goodman, "Some effects of target-induced scintillation
        on optical radar performance", Proc. IEEE 1965). The fraction of the signals above the detector's threshold is
        therefore exp(-threshold / signal). At ``detection_range`` and normal incidence, this fraction is
        ``detection_probability``.
        """
        if self._rng is None:
            return distance, np.ones(len(distance), np.bool_)
        sensor, count = self.model, len(distance)
        normal, uniform = self._rng.standard_normal(count, np.float32), self._rng.random(count, np.float32)
        near, far = sensor.sigma
        sigma = (near + (far - near) / sensor.range[1] * distance) / np.maximum(cosine, MIN_COSINE)
        weakness = (distance / sensor.detection_range) ** 2 / np.maximum(cosine, 1e-6)
        return distance + sigma * normal, uniform < sensor.detection_probability**weakness


def _robot_site(world: mujoco.MjModel, root: int) -> int | None:
    """Id of the robot's site ``lidar``, with or without a prefix to its name; None if there is none."""
    for site in np.flatnonzero(world.body_rootid[world.site_bodyid] == root).tolist():
        if world.site(site).name.rpartition("/")[2] == SITE:
            return int(site)
    return None


def _interpolated_poses(t0: float, T0: Pose, t1: float, T1: Pose, times: NDArray[np.floating]) -> Poses:
    """(K, 4, 4) poses at ``times``, (K,) s, interpolated between two poses and constant before and after them."""
    fraction = np.clip((times - t0) / (t1 - t0), 0, 1)
    poses = np.tile(np.eye(4), (len(times), 1, 1))
    poses[:, :3, :3] = Slerp([0, 1], Rotation.from_matrix([T0[:3, :3], T1[:3, :3]]))(fraction).as_matrix()
    poses[:, :3, 3] = T0[:3, 3] + fraction[:, None] * (T1 - T0)[:3, 3]
    return poses


def _joined(parts: list[Scan]) -> Scan:
    """One scan from its parts, which are in order of time."""
    names = ("points", "range", "ring", "column", "time", "normal", "label", "instance")
    first = parts[0]
    return Scan(first.start, first.T_world_lidar, *(np.concatenate([getattr(p, n) for p in parts]) for n in names))
