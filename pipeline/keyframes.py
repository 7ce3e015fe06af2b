"""The keyframes: observations relative to the pose of each keyframe, and the poses from which all maps are built.

A map is a fold over the keyframes in order, so it can be rebuilt for any poses. A place on the map, such as the place
of a node, is anchored to a keyframe and evaluated at the keyframe's current pose.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from pipeline.arrays import Box, Boxes, Depth, Indices, Mask, Points, Pose, Poses, Probabilities, Values
from pipeline.elevation_map.config import ElevationConfig
from pipeline.elevation_map.elevation_kernels import lowest_rays
from pipeline.elevation_map.elevation_map import RAY_HEIGHT, ElevationMap
from pipeline.elevation_map.ground_evidence import (
    AssumedGround,
    GroundEvidence,
    box_of,
    find_depth_dropouts,
    find_overhangs,
    turning_radius,
)
from pipeline.errors import InputError
from pipeline.frame import Frame, Intrinsics
from pipeline.geometry.moving_kernels import moved
from pipeline.geometry.thinning import VoxelCloud
from pipeline.metric_map.metric_map import MetricMap
from pipeline.robot import RobotModel
from pipeline.semantic_map.semantic_map import SemanticMap
from pipeline.semantic_map.top_two_classes import TopTwoClasses
from pipeline.transforms import POSE_REQUIREMENT, are_poses, transform_places, yaw_of

UNIT = 2.5e-4
"""Resolution of the stored points and depths, m: a fifth of the noise of the best depth camera."""
MAX_COORDINATE = np.iinfo(np.int16).max * UNIT
"""Largest coordinate that can be stored, m: more than the indoor range of any depth camera."""


@dataclass(frozen=True, eq=False)
class KeyframeObservation:
    """A keyframe's observations, thinned and relative to the keyframe's pose, from which every map can be rebuilt.

    Attributes:
        depth: (h, w) uint16 depth of every n-th pixel along the optical axis, in ``UNIT``; 0 = no return.
        intrinsics: intrinsics of this depth image.
        T_base_camera: pose of the camera in ``base_link``.
        points: (N, 3) int16 returns in ``base_link``, in ``UNIT``, thinned to the voxels of the semantic map. The
            returns of an unlabelled frame are thinned to half a cell and one height bin of the elevation map.
        hits: (N,) uint8 number of returns averaged in each point, at most 255.
        above: (N,) uint8 state of the space above each point, see :func:`find_overhangs`.
        dropouts: (M, 3) int16 points in ``base_link``, in ``UNIT``, where ground should have been seen but was not,
            see :func:`find_depth_dropouts`.
        dropout_hits: (M,) uint8 number of pixels averaged in each dropout, at most 255.
        rays: (R, 3) int16 lowest points, in ``base_link``, in ``UNIT``, of the rays that passed over ground without
            returns.
        top_two_classes: the two most probable classes of the points; None if the frame was not labelled.
    """

    depth: NDArray[np.uint16]
    intrinsics: Intrinsics
    T_base_camera: Pose
    points: NDArray[np.int16]
    hits: NDArray[np.uint8]
    above: NDArray[np.uint8]
    dropouts: NDArray[np.int16]
    dropout_hits: NDArray[np.uint8]
    rays: NDArray[np.int16]
    top_two_classes: TopTwoClasses | None = None

    @classmethod
    def of(
        cls,
        frame: Frame,
        points: Points,
        probabilities: Probabilities | None,
        stride: int,
        voxel: float,
        config: ElevationConfig,
        robot: RobotModel,
    ) -> "KeyframeObservation":
        """The thinned observation of a frame.

        Args:
            frame: the frame.
            points: the frame's returns in ``base_link``.
            probabilities: class probabilities of the returns; None if the frame is not labelled.
            stride: step between stored depths, pixels.
            voxel: voxel size of the semantic map, m, used to thin a labelled frame.
            config: settings of the elevation map, used to thin an unlabelled frame.
            robot: the robot, which determines the room needed to turn in place, and the headroom.
        """
        half = config.cell / 2
        cloud, near = kept_cloud(points, (half, half, config.bin) if probabilities is None else voxel)
        top_two_classes = None if probabilities is None else TopTwoClasses.of(cloud.means(probabilities)[near])
        T, camera = frame.T_base_camera, frame.T_base_camera[:3, 3]
        dropouts = find_depth_dropouts(frame.depth, frame.intrinsics, T, frame.sensor, turning_radius(robot))
        missing, missing_near = kept_cloud(dropouts, half)
        reach = config.cell, RAY_HEIGHT, config.min_returns
        rays = lowest_rays(cloud.points[near], cloud.hits[near], camera, *reach)
        depth, intrinsics = frame.every_nth(stride)
        kept = np.where(np.isfinite(depth) & (depth > 0), depth / UNIT, 0).clip(max=np.iinfo(np.uint16).max)
        return cls(
            depth=np.rint(kept).astype(np.uint16),
            intrinsics=intrinsics,
            T_base_camera=frame.T_base_camera,
            points=_packed(cloud.points[near]),
            hits=_count(cloud.hits[near]),
            above=find_overhangs(frame, cloud.points[near], robot.headroom),
            dropouts=_packed(missing.points[missing_near]),
            dropout_hits=_count(missing.hits[missing_near]),
            rays=_packed(rays),
            top_two_classes=top_two_classes,
        )

    @property
    def nbytes(self) -> int:
        """Size of the arrays in bytes."""
        arrays = self.depth, self.points, self.hits, self.above, self.dropouts, self.dropout_hits, self.rays
        return sum(array.nbytes for array in arrays) + (self.top_two_classes.nbytes if self.top_two_classes else 0)

    @property
    def frame(self) -> Frame:
        """A frame with only the stored depth, without colours, time or pose."""
        no_colour = np.zeros((0, 0, 3), np.uint8)
        return Frame(0.0, no_colour, self._depth, self.intrinsics, self.T_base_camera, np.eye(4))

    @property
    def _depth(self) -> Depth:
        return self.depth * np.float32(UNIT)

    def points_at(self, T_map_base: Pose) -> Points:
        """The points in ``map``, m, for a given pose of the robot."""
        return _placed(self.points, T_map_base)

    @property
    def box(self) -> Box:
        """Bounding box of the points and dropouts, m in ``base_link``."""
        return box_of(self.points * UNIT, self.dropouts * UNIT)

    def view_frustum(self, reach: float) -> NDArray[np.float64]:
        """(5, 3) corners of the view frustum up to a depth of ``reach`` m, in ``base_link``, m."""
        return transform_places(self.T_base_camera, self.intrinsics.frustum * reach)

    def add_to_metric_map(self, metric_map: MetricMap, T_map_base: Pose) -> None:
        """Add the returns, and the space seen to be free, to the metric map for a given pose of the robot."""
        T_map_camera = T_map_base @ self.T_base_camera
        metric_map.integrate(self._depth, self.intrinsics, T_map_camera, self.points_at(T_map_base))

    def add_to_semantic_map(self, semantic_map: SemanticMap, T_map_base: Pose, number: int) -> None:
        """Add any labelled points to the semantic map for a pose of the robot; ``number``: index of the keyframe."""
        if self.top_two_classes is not None:
            semantic_map.update(self.points_at(T_map_base), self.top_two_classes.probabilities, self.hits, number)

    def add_to_elevation_map(self, elevation_map: ElevationMap, T_map_base: Pose) -> None:
        """Add the returns, dropouts, rays and robot's footprint to the elevation map for a pose of the robot."""
        points, dropouts, rays = (_placed(p, T_map_base) for p in (self.points, self.dropouts, self.rays))
        camera, height = (T_map_base @ self.T_base_camera)[:3, 3], float(T_map_base[2, 3])
        elevation_map.update(points, self.hits, dropouts, self.dropout_hits, rays, camera, self.above, height)
        elevation_map.add_track(np.array([[*T_map_base[:2, 3], yaw_of(T_map_base)]]))


def _packed(points: NDArray[np.floating]) -> NDArray[np.int16]:
    """(N, 3) points, converted from m to ``UNIT``."""
    return np.rint(points / UNIT).astype(np.int16)


def _placed(points: NDArray[np.int16], T_map_base: Pose) -> Points:
    """Stored points in ``map``, m, for a given pose of the robot."""
    return moved(T_map_base * (UNIT, UNIT, UNIT, 1.0), points)


def _count(hits: NDArray[np.uint32]) -> NDArray[np.uint8]:
    return hits.clip(max=np.iinfo(np.uint8).max).astype(np.uint8)


def kept_cloud(points: Points, voxel: float | tuple[float, float, float]) -> tuple[VoxelCloud, NDArray[np.intp]]:
    """Points in ``base_link`` thinned to voxels of size ``voxel``, m, and (K,) indices of those to be stored."""
    cloud = VoxelCloud.of(points, voxel)
    return cloud, np.flatnonzero((np.abs(cloud.points) < MAX_COORDINATE).all(axis=1))


class Moves(NamedTuple):
    """How far keyframes moved in a correction.

    Attributes:
        distances: distance that each keyframe moved, m.
        turns: angle by which each keyframe turned, rad.
        reach: range of the keyframes' view, m.
        min_displacement: see :class:`pipeline.config.KeyframesConfig`.
    """

    distances: Values
    turns: Values
    reach: float
    min_displacement: float

    @classmethod
    def between(cls, before: Poses, after: Poses, reach: float, min_displacement: float) -> "Moves":
        """The moves between two sets of poses of keyframes with a range of view of ``reach`` m."""
        turned = before[:, :3, :3].swapaxes(1, 2) @ after[:, :3, :3]
        ways, turns = np.linalg.norm((after - before)[:, :3, 3], axis=1), Rotation.from_matrix(turned).magnitude()
        return cls(ways, turns, reach, min_displacement)

    @property
    def max_displacements(self) -> Values:
        """Largest displacement of each keyframe or of anything in its view, m."""
        return np.maximum(self.distances, self.turns * self.reach)

    @property
    def are_noticeable(self) -> Mask:
        """(K,) whether each keyframe moved noticeably, at its own position or at the end of its view."""
        return self.max_displacements > self.min_displacement


class Keyframes:
    """The observations of all keyframes, and their poses.

    Attributes:
        observations: the observation of each keyframe.
        ground_evidence: all evidence about the ground in the order in which it was found, each item preceded by the
            index of its keyframe.
        poses: (K, 4, 4) ``T_map_base`` of the keyframes, from which the maps are built.
        loaded_count: number of keyframes from an earlier episode.
    """

    def __init__(self, robot: RobotModel, reach: float, cell: float, min_displacement: float) -> None:
        """Start without keyframes.

        Args:
            robot: the robot that takes the keyframes.
            reach: depth up to which a view marks space as free, m.
            cell: cell size of the elevation map, m.
            min_displacement: threshold in m; see :class:`pipeline.config.KeyframesConfig`.
        """
        self.observations: list[KeyframeObservation] = []
        self.ground_evidence: list[tuple[int, GroundEvidence]] = []
        self.poses = np.zeros((0, 4, 4))
        self.loaded_count = 0
        self._reach, self._margin, self._min_displacement = reach, robot.half_width + cell, min_displacement
        self._boxes = np.zeros((0, 2, 3))

    def __len__(self) -> int:
        return len(self.observations)

    def add(self, seen: KeyframeObservation, T_map_base: Pose) -> None:
        """Add a keyframe with its pose."""
        self.observations.append(seen)
        self.poses = np.concatenate([self.poses, T_map_base[None]])
        self._boxes = np.concatenate([self._boxes, box_of(seen.box, seen.view_frustum(self._reach))[None]])

    def add_ground(self, keyframe: int, evidence: GroundEvidence) -> None:
        """Add evidence about the ground near a keyframe."""
        self.ground_evidence.append((keyframe, evidence))
        self._boxes[keyframe] = box_of(self._boxes[keyframe], evidence.box)

    def boxes(self) -> Boxes:
        """For each keyframe, the bounding box of everything that it changes in the maps."""
        middle, half = self._boxes.mean(axis=1), np.diff(self._boxes, axis=1)[:, 0] / 2 + self._margin
        R, t = self.poses[:, :3, :3], self.poses[:, :3, 3]
        centre = np.einsum("kij,kj->ki", R, middle) + t
        reach = np.einsum("kij,kj->ki", np.abs(R), half)
        return np.stack([centre - reach, centre + reach], axis=1)

    @property
    def start_height(self) -> float:
        """Height in ``map`` at which the robot was set down, m; 0 without a set-down, as with a hand-held camera."""
        return next(
            (
                float(self.poses[k, 2, 3])
                for k, evidence in self.ground_evidence
                if isinstance(evidence, AssumedGround)
            ),
            0.0,
        )

    @property
    def highest_camera(self) -> float:
        """Maximum height of the keyframes' cameras in ``map``, m; 0 without keyframes."""
        heights = [T[2] @ seen.T_base_camera[:, 3] for T, seen in zip(self.poses, self.observations, strict=True)]
        return float(max(heights, default=0.0))

    def apply_poses(self, T_map_base: Poses) -> Moves:
        """Move the keyframes to their newly estimated poses, except keyframes whose move is not noticeable.

        Returns:
            How far each keyframe moved; 0 for keyframes that stayed.

        Raises:
            InputError: the argument is not one rigid pose for each keyframe. The keyframes are unchanged.
        """
        stays, poses = ~self.moves_to(T_map_base).are_noticeable, np.array(T_map_base, np.float64)
        poses[stays] = self.poses[stays]
        moves, self.poses = self.moves_to(poses), poses
        return moves

    def moves_to(self, T_map_base: Poses) -> Moves:
        """How far the poses ``T_map_base`` would move the keyframes; InputError as in :meth:`apply_poses`."""
        poses = np.asarray(T_map_base, np.float64)
        if poses.shape != self.poses.shape:
            raise InputError(
                f"the corrected poses of {len(self)} keyframes must have shape {self.poses.shape}, not {poses.shape}"
            )
        if not are_poses(poses):
            raise InputError(f"the corrected pose of each of the {len(self)} keyframes must be {POSE_REQUIREMENT}")
        return Moves.between(self.poses, poses, self._reach, self._min_displacement)


@dataclass(frozen=True, eq=False)
class AnchoredPlaces:
    """Places on the map, each anchored to a keyframe.

    Attributes:
        keyframe: (N,) index of each place's keyframe.
        position: (N, 3) positions in the keyframe's ``base_link``, m.
    """

    keyframe: Indices
    position: NDArray[np.float64]

    @classmethod
    def anchored(cls, places: ArrayLike, poses: Poses, keyframe: int | None = None) -> "AnchoredPlaces":
        """Anchor places (N, 2 or 3) in ``map``, m, to a given keyframe, or each place to the nearest keyframe.

        ``poses``: the poses of all keyframes, at least one. Places without a height get the height of their keyframe.
        """
        places = np.asarray(places, np.float64)
        owner = np.full(len(places), keyframe, np.int64) if keyframe is not None else nearest_keyframes(places, poses)
        if places.shape[1:] == (2,):
            places = np.column_stack([places, poses[owner, 2, 3]])
        T = poses[owner]
        return cls(owner, np.einsum("nji,nj->ni", T[:, :3, :3], places.reshape(-1, 3) - T[:, :3, 3]))

    def at(self, poses: Poses) -> NDArray[np.float64]:
        """(N, 3) places in ``map``, m, for given poses of the keyframes."""
        T = poses[self.keyframe]
        return np.asarray(np.einsum("nij,nj->ni", T[:, :3, :3], self.position) + T[:, :3, 3])

    @classmethod
    def joined(cls, parts: Iterable["AnchoredPlaces"]) -> "AnchoredPlaces":
        """Concatenate several sets of places."""
        parts = [cls(np.zeros(0, np.int64), np.zeros((0, 3))), *parts]
        return cls(np.concatenate([p.keyframe for p in parts]), np.concatenate([p.position for p in parts]))


def nearest_keyframes(places: NDArray[np.floating], poses: Poses) -> Indices:
    """Index of the keyframe nearest to each place (N, 2 or 3) in ``map``, m."""
    return np.asarray(cKDTree(poses[:, :2, 3]).query(places[:, :2])[1], np.int64).reshape(-1)
