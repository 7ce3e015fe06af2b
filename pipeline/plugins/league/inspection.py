"""Inspection of walls that no keyframe has shown closely and frontally enough for signs on them to be readable."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from pipeline.arrays import Directions, Indices, Mask, Place, Poses, Values
from pipeline.elevation_map.pose_kernels import HEADING_ANGLES
from pipeline.exploration.config import ExplorationConfig
from pipeline.exploration.viewpoint import Context, Strategy, Viewpoint
from pipeline.frame import Frame
from pipeline.grid_map import best_of_blocks
from pipeline.keyframes import UNIT, AnchoredPlaces, KeyframeObservation, Keyframes
from pipeline.metric_map.metric_map import MetricMap
from pipeline.planning.pose_paths import heading_mask
from pipeline.plugins.league.config import InspectionConfig
from pipeline.transforms import transform_places, wrap_angle


class WallPieces(NamedTuple):
    """Pieces of walls, each shown by one square of an image.

    Attributes:
        points: (N, 3) m, centres of the pieces.
        normals: normals that point away from the wall.
        sign_widths: foreshortened width of a typical sign on each piece, as the keyframe would show it, pixels.
        config: settings of the inspection.
    """

    points: NDArray[np.float64]
    normals: Directions
    sign_widths: Values
    config: InspectionConfig

    @classmethod
    def of(cls, seen: KeyframeObservation, frame: Frame, config: InspectionConfig) -> "WallPieces":
        """The pieces that a keyframe shows, in its ``base_link``: image squares that are flat, upright and low.

        ``frame``: any frame of the same camera.
        """
        squares = _squares(seen.intrinsics.rays * (seen.depth * UNIT)[..., None], config.square)
        middle = squares.mean(axis=1)
        apart = squares - middle[:, None]
        variances, axes = np.linalg.eigh(apart.swapaxes(1, 2) @ apart / apart.shape[1])
        normals = axes[..., 0] * -np.sign((axes[..., 0] * middle).sum(axis=1))[:, None]
        T = seen.T_base_camera
        found = cls(transform_places(T, middle), normals @ T[:3, :3].T, np.zeros(len(middle)), config)
        is_flat = variances[:, 0] < (config.flatness * frame.sensor.sigma(middle[:, 2])) ** 2
        is_upright = np.abs(found.normals[:, 2]) < config.upright
        height = found.points[:, 2]
        found = found.where(is_flat & is_upright & (height > 0) & (height < config.highest))
        return found._replace(sign_widths=found.sign_widths_from(T[None, :3, 3], frame)[:, 0])

    def where(self, index: Mask | Indices) -> "WallPieces":
        """The pieces that a mask or indices select."""
        return WallPieces(self.points[index], self.normals[index], self.sign_widths[index], self.config)

    def sign_widths_from(self, cameras: ArrayLike, frame: Frame) -> NDArray[np.float64]:
        """(N, M) pixels, foreshortened width of a sign on each piece, seen by cameras at (M, 3) m; 0 from behind."""
        ways = np.asarray(cameras, np.float64) - self.points[:, None]
        distances = np.maximum(np.linalg.norm(ways, axis=2), frame.sensor.nearest / 2)
        cosines = np.einsum("nmi,ni->nm", ways, self.normals) / distances
        return frame.intrinsics.fx * self.config.sign * np.maximum(cosines, 0) / distances

    @property
    def points_in_front(self) -> NDArray[np.float64]:
        """(N, 3) m, the point in front of each piece that represents it."""
        return self.points + self.config.standoff * self.normals


class Inspection(Strategy):
    """Drives to the pose from which a remaining wall can be inspected soonest; each wall is aimed at only once."""

    def __init__(
        self, keyframes: Keyframes, metric_map: MetricMap, *, config: ExplorationConfig, walls: InspectionConfig
    ):
        """Inspect the walls that the keyframes show, along lines of sight that are free in the map."""
        self._keyframes = keyframes
        self._map = metric_map
        self._config = config
        self._walls = walls
        self._shown: list[WallPieces] = []
        self._aimed: list[AnchoredPlaces] = []

    def observe(self, context: Context) -> None:
        """Do nothing, because the keyframes store their own observations."""

    def next_viewpoint(self, context: Context) -> Viewpoint | None:
        """The pose that the robot reaches soonest among those from which signs on a remaining wall are readable.

        None if there is no such pose.
        """
        left = self._remaining(context)
        paths = context.paths
        cells = best_of_blocks(np.bitwise_count(paths.headings), self._config.visibility.stride)
        if not len(left.points) or not len(cells):
            return None
        places = context.traversability.on_ground(context.traversability.grid.centre_of(cells))
        cameras = places + _camera_offset(context.frame)
        ahead = np.abs(wrap_angle(_bearings(left, places)[..., None] - HEADING_ANGLES)).argmin(axis=2)
        seconds = np.where(heading_mask(paths.headings[tuple(cells.T)]), paths.seconds_to(cells), np.inf)
        cost = np.where(self._shows(left, places, context.frame), seconds[np.arange(len(cells)), ahead], np.inf)
        for index in np.argsort(cost, axis=None, kind="stable"):
            wall, place = np.unravel_index(index, cost.shape)
            if np.isinf(cost[wall, place]):
                break
            if self._is_line_free(cameras[place], left.points[wall]):
                heading = wrap_angle(float(HEADING_ANGLES[ahead[wall, place]]))
                seconds_there = self._config.keyframe_time + float(cost[wall, place])
                return Viewpoint(places[place, :2], heading, True, 0.0, seconds_there)
        return None

    def commit(self, viewpoint: Viewpoint, context: Context) -> None:
        """Mark the walls that are readable from the viewpoint as aimed at."""
        left = self._remaining(context)
        place = context.traversability.on_ground(viewpoint.position[None])
        off = np.abs(wrap_angle(_bearings(left, place)[:, 0] - viewpoint.heading))
        is_aimed = self._shows(left, place, context.frame)[:, 0] & (off < context.frame.intrinsics.half_fov)
        camera = place[0] + _camera_offset(context.frame)
        is_aimed[is_aimed] = [self._is_line_free(camera, point) for point in left.points[is_aimed]]
        aimed = left.where(is_aimed).points_in_front
        self._aimed.append(AnchoredPlaces.anchored(aimed, context.poses, len(context.poses) - 1))

    def _is_line_free(self, camera: Place, point: Place) -> bool:
        """Whether the line of sight between a camera and a point on a wall is free."""
        free = self._walls.depth, self._walls.beside_camera
        return bool(self._map.are_sightlines_free(camera[None], point, cKDTree(point[None]), *free)[0])

    def _remaining(self, context: Context) -> WallPieces:
        """The pieces of walls that were neither shown well enough nor aimed at, thinned to one per grid cell."""
        for seen in self._keyframes.observations[len(self._shown) :]:
            self._shown.append(WallPieces.of(seen, context.frame, self._walls))
        walls = _in_map(self._shown, context.poses, self._walls)
        is_read = walls.sign_widths >= self._walls.readable
        aimed = AnchoredPlaces.joined(self._aimed).at(context.poses)
        done = np.concatenate([walls.points_in_front[is_read], aimed])[:, :2]
        left = walls.where(~is_read)
        if len(done) and len(left.points):
            left = left.where(cKDTree(done).query(left.points_in_front[:, :2])[0] > self._walls.spacing)
        _, first = np.unique(np.floor(left.points_in_front[:, :2] / self._walls.spacing), axis=0, return_index=True)
        return left.where(first)

    def _shows(self, walls: WallPieces, places: NDArray[np.float64], frame: Frame) -> NDArray[np.bool_]:
        """(N, M) whether a sign on each of N pieces is readable and not too close to a camera above each position.

        ``places``: (M, 3) m, positions on the ground.
        """
        cameras = places + _camera_offset(frame)
        far = np.linalg.norm(cameras - walls.points[:, None], axis=2) >= frame.sensor.nearest + frame.sensor.margin
        return far & (walls.sign_widths_from(cameras, frame) >= self._walls.readable)


def _in_map(shown: list[WallPieces], poses: Poses, config: InspectionConfig) -> WallPieces:
    """All pieces of walls, transformed from the ``base_link`` of the keyframe that has shown them to ``map``."""
    T = np.repeat(poses, [len(walls.points) for walls in shown], axis=0)
    points, normals, sign_widths = (
        np.concatenate([getattr(walls, name) for walls in shown]) for name in ("points", "normals", "sign_widths")
    )
    R, t = T[:, :3, :3], T[:, :3, 3]
    points, normals = np.einsum("nij,nj->ni", R, points) + t, np.einsum("nij,nj->ni", R, normals)
    return WallPieces(points, normals, sign_widths, config)


def _camera_offset(frame: Frame) -> Place:
    """(3,) m, offset of a frame's camera from the robot's position on the ground."""
    return np.array([0.0, 0.0, frame.T_base_camera[2, 3]])


def _bearings(walls: WallPieces, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, M) bearings of N pieces of walls from positions (M, 3), rad."""
    ways = walls.points[:, None] - places
    return np.arctan2(ways[..., 1], ways[..., 0])


def _squares(points: NDArray[np.float32], side: int) -> NDArray[np.float64]:
    """(N, S², 3) m, the squares of S × S points in an image (H, W, 3) of points; every point must be a return."""
    h, w = points.shape[0] // side, points.shape[1] // side
    parts = points[: h * side, : w * side].reshape(h, side, w, side, 3).swapaxes(1, 2).reshape(h * w, side**2, 3)
    return parts[(parts[..., 2] > 0).all(axis=1)].astype(np.float64)
