"""The keyframes: what each has shown, kept relative to its own pose, and the only poses that maps and places use.

A map is a fold over the keyframes in their order: it can be made anew at any poses. A place, as that of a node, is
anchored to a keyframe and read at the keyframe's present pose.
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
from pipeline.elevation_map.depth_dropouts import find_depth_dropouts
from pipeline.elevation_map.elevation_kernels import lowest_rays
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.ground_evidence import Assumed, GroundEvidence, box_of
from pipeline.elevation_map.overhangs import find_overhangs
from pipeline.errors import InputError
from pipeline.frame import Frame, Intrinsics
from pipeline.geometry.moving_kernels import moved
from pipeline.geometry.thinning import VoxelCloud
from pipeline.metric_map.metric_map import MetricMap
from pipeline.robot import RobotModel
from pipeline.semantic_map.class_shares import ClassShares
from pipeline.semantic_map.semantic_map import SemanticMap
from pipeline.transforms import POSE, are_poses, yaw_of

UNIT = 2.5e-4
"""m, to which kept points and depths are rounded: a fifth of the noise of the best depth camera."""
FARTHEST_KEPT = np.iinfo(np.int16).max * UNIT
"""m along an axis; returns farther away, beyond the range of any depth camera indoors, are left out."""


@dataclass(frozen=True, eq=False)
class Seen:
    """What a keyframe has shown, relative to its own pose, thinned: enough to make every map again at other poses.

    Attributes:
        depth: (h, w) uint16, every n-th pixel's depth along the optical axis, in ``UNIT``; 0 = no return.
        intrinsics: of this depth image.
        T_base_camera: pose of the camera.
        points: (N, 3) int16 the returns in ``base_link``, in ``UNIT``, thinned to the voxels of the semantic map, or
            to half a cell of the elevation map and one of its bins if the frame was not labelled.
        hits: (N,) uint8 number of returns that each point is the mean of, 255 at most.
        above: (N,) uint8 what was seen of the space above each point, see :func:`find_overhangs`.
        dropouts: (M, 3) int16 where ground should have been seen, see :func:`find_depth_dropouts`.
        dropout_hits: (M,) uint8 number of pixels that each of these is the mean of.
        rays: (R, 3) int16 lowest points of rays over the ground in places without returns.
        shares: classes of the points; None if the frame was not labelled.
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
    shares: ClassShares | None = None

    @classmethod
    def of(
        cls,
        frame: Frame,
        points: Points,
        probabilities: Probabilities | None,
        stride: int,
        voxel: float,
        config: ElevationConfig,
        headroom: float,
    ) -> "Seen":
        """What a frame shows.

        Args:
            frame: with its depth.
            points: its returns in ``base_link``.
            probabilities: of the returns; None if the frame is not labelled.
            stride: pixels from one kept depth to the next.
            voxel: m, of the semantic map, to which a labelled frame is thinned.
            config: of the elevation map, for which one that is not labelled is thinned.
            headroom: m that the robot needs above the ground.
        """
        half = config.cell / 2
        cloud, near = kept_cloud(points, (half, half, config.bin) if probabilities is None else voxel)
        shares = None if probabilities is None else ClassShares.of(cloud.means(probabilities)[near])
        T, camera = frame.T_base_camera, frame.T_base_camera[:3, 3]
        dropouts = find_depth_dropouts(frame.depth, frame.intrinsics, T, frame.sensor, config.dropouts)
        missing, missing_near = kept_cloud(dropouts, half)
        reach = config.cell, config.ray_height, config.fewest
        rays = lowest_rays(cloud.points[near], cloud.hits[near], camera, *reach)
        depth, intrinsics = frame.every_nth(stride)
        kept = np.where(np.isfinite(depth) & (depth > 0), depth / UNIT, 0).clip(max=np.iinfo(np.uint16).max)
        return cls(
            depth=np.rint(kept).astype(np.uint16),
            intrinsics=intrinsics,
            T_base_camera=frame.T_base_camera,
            points=_packed(cloud.points[near]),
            hits=_count(cloud.hits[near]),
            above=find_overhangs(frame, cloud.points[near], headroom, config.overhangs),
            dropouts=_packed(missing.points[missing_near]),
            dropout_hits=_count(missing.hits[missing_near]),
            rays=_packed(rays),
            shares=shares,
        )

    @property
    def nbytes(self) -> int:
        """Bytes of its arrays."""
        arrays = self.depth, self.points, self.hits, self.above, self.dropouts, self.dropout_hits, self.rays
        return sum(array.nbytes for array in arrays) + (self.shares.nbytes if self.shares else 0)

    @property
    def frame(self) -> Frame:
        """A frame of the kept depth alone, without colours, time and pose."""
        no_colour = np.zeros((0, 0, 3), np.uint8)
        return Frame(0.0, no_colour, self._depth, self.intrinsics, self.T_base_camera, np.eye(4))

    @property
    def _depth(self) -> Depth:
        return self.depth * np.float32(UNIT)

    def points_at(self, T_map_base: Pose) -> Points:
        """Its points at a pose of the robot."""
        return _placed(self.points, T_map_base)

    @property
    def box(self) -> Box:
        """The box around its points and dropouts, in ``base_link``."""
        return box_of(self.points * UNIT, self.dropouts * UNIT)

    def view(self, reach: float) -> NDArray[np.float64]:
        """(5, 3) corners of its view up to ``reach`` m of depth, m in ``base_link``."""
        return self.intrinsics.frustum * reach @ self.T_base_camera[:3, :3].T + self.T_base_camera[:3, 3]

    def put_depth(self, metric_map: MetricMap, T_map_base: Pose) -> None:
        """Add its returns and the space that it saw free, at a pose of the robot."""
        T_map_camera = T_map_base @ self.T_base_camera
        metric_map.integrate(self._depth, self.intrinsics, T_map_camera, self.points_at(T_map_base))

    def put_classes(self, semantic_map: SemanticMap, T_map_base: Pose, number: int) -> None:
        """Add its labelled points, if it has any, at a pose of the robot; ``number``: of the keyframe."""
        if self.shares is not None:
            semantic_map.update(self.points_at(T_map_base), self.shares.probabilities, self.hits, number)

    def put(self, elevation_map: ElevationMap, T_map_base: Pose) -> None:
        """Add its returns, dropouts and rays, and that the robot can stand there, at a pose of the robot."""
        points, dropouts, rays = (_placed(p, T_map_base) for p in (self.points, self.dropouts, self.rays))
        camera = (T_map_base @ self.T_base_camera)[:3, 3]
        elevation_map.update(points, self.hits, dropouts, self.dropout_hits, rays, camera, self.above)
        elevation_map.add_track(np.array([[*T_map_base[:2, 3], yaw_of(T_map_base)]]))


def _packed(points: NDArray[np.floating]) -> NDArray[np.int16]:
    """(N, 3) points in ``UNIT``."""
    return np.rint(points / UNIT).astype(np.int16)


def _placed(points: NDArray[np.int16], T_map_base: Pose) -> Points:
    """Kept points at a pose."""
    return moved(T_map_base * (UNIT, UNIT, UNIT, 1.0), points)


def _count(hits: NDArray[np.uint32]) -> NDArray[np.uint8]:
    return hits.clip(max=np.iinfo(np.uint8).max).astype(np.uint8)


def kept_cloud(points: Points, voxel: float | tuple[float, float, float]) -> tuple[VoxelCloud, NDArray[np.intp]]:
    """Points in ``base_link`` thinned to voxels of that size, m, and which (K,) of these are kept."""
    cloud = VoxelCloud.of(points, voxel)
    return cloud, np.flatnonzero((np.abs(cloud.points) < FARTHEST_KEPT).all(axis=1))


class Moves(NamedTuple):
    """How far keyframes moved in a correction.

    Attributes:
        ways: m.
        turns: rad.
        reach: m, how far they see.
        noticeable: see :class:`pipeline.config.KeyframesConfig`.
    """

    ways: Values
    turns: Values
    reach: float
    noticeable: float

    @classmethod
    def between(cls, before: Poses, after: Poses, reach: float, noticeable: float) -> "Moves":
        """From poses to others, of keyframes that see ``reach`` m far."""
        turned = before[:, :3, :3].swapaxes(1, 2) @ after[:, :3, :3]
        ways, turns = np.linalg.norm((after - before)[:, :3, 3], axis=1), Rotation.from_matrix(turned).magnitude()
        return cls(ways, turns, reach, noticeable)

    @property
    def in_view(self) -> Values:
        """m that each keyframe, or what it sees at the end of its view, moved."""
        return np.maximum(self.ways, self.turns * self.reach)

    @property
    def are_noticeable(self) -> Mask:
        """Which keyframes, or what they see at the end of their view, moved noticeably."""
        return self.in_view > self.noticeable


class Keyframes:
    """What all keyframes have shown, and their poses.

    Attributes:
        seen: what each has shown.
        ground: all evidence of the ground in the order in which it was found, each with the number of its keyframe.
        poses: ``T_map_base`` at which they are in the maps.
        loaded: number of keyframes from an earlier episode.
    """

    def __init__(self, robot: RobotModel, reach: float, cell: float, noticeable: float) -> None:
        """None yet.

        Args:
            robot: on whose ground they stand.
            reach: m of depth up to which a view frees space.
            cell: m, edge of the cells of the ground.
            noticeable: m; see :class:`pipeline.config.KeyframesConfig`.
        """
        self.seen: list[Seen] = []
        self.ground: list[tuple[int, GroundEvidence]] = []
        self.poses = np.zeros((0, 4, 4))
        self.loaded = 0
        self._reach, self._margin, self._noticeable = reach, robot.half_width + cell, noticeable
        self._boxes = np.zeros((0, 2, 3))

    def __len__(self) -> int:
        return len(self.seen)

    def add(self, seen: Seen, T_map_base: Pose) -> None:
        """Add a keyframe at a pose."""
        self.seen.append(seen)
        self.poses = np.concatenate([self.poses, T_map_base[None]])
        self._boxes = np.concatenate([self._boxes, box_of(seen.box, seen.view(self._reach))[None]])

    def add_ground(self, keyframe: int, evidence: GroundEvidence) -> None:
        """Add evidence of the ground near a keyframe."""
        self.ground.append((keyframe, evidence))
        self._boxes[keyframe] = box_of(self._boxes[keyframe], evidence.box)

    def boxes(self) -> Boxes:
        """The boxes around all that each keyframe changes in the maps."""
        middle, half = self._boxes.mean(axis=1), np.diff(self._boxes, axis=1)[:, 0] / 2 + self._margin
        R, t = self.poses[:, :3, :3], self.poses[:, :3, 3]
        centre = np.einsum("kij,kj->ki", R, middle) + t
        reach = np.einsum("kij,kj->ki", np.abs(R), half)
        return np.stack([centre - reach, centre + reach], axis=1)

    @property
    def start_height(self) -> float:
        """m in ``map`` at which the robot was set down; 0 if it was not, as a camera in a hand is not."""
        return next((float(self.poses[k, 2, 3]) for k, evidence in self.ground if isinstance(evidence, Assumed)), 0.0)

    @property
    def highest_camera(self) -> float:
        """m, the greatest height at which a keyframe's camera was; 0 if all were lower."""
        heights = [T[2] @ seen.T_base_camera[:, 3] for T, seen in zip(self.poses, self.seen, strict=True)]
        return float(max(heights, default=0.0))

    def place(self, T_map_base: Poses) -> Moves:
        """Move the keyframes to their poses as now estimated, except those that move unnoticeably.

        Returns:
            How far each moved; 0 for those that stayed.

        Raises:
            InputError: there is not one rigid pose for every keyframe; all then stay where they are.
        """
        stays, poses = ~self.moves_to(T_map_base).are_noticeable, np.array(T_map_base, np.float64)
        poses[stays] = self.poses[stays]
        moves, self.poses = self.moves_to(poses), poses
        return moves

    def moves_to(self, T_map_base: Poses) -> Moves:
        """How far the keyframes are from poses; InputError as :meth:`place`."""
        poses = np.asarray(T_map_base, np.float64)
        if poses.shape != self.poses.shape or not are_poses(poses):
            raise InputError(f"a correction must give each of {len(self)} keyframes {POSE}")
        return Moves.between(self.poses, poses, self._reach, self._noticeable)


@dataclass(frozen=True, eq=False)
class Places:
    """Places on the map, each anchored to a keyframe.

    Attributes:
        keyframe: number of each place's keyframe.
        position: (N, 3) m in the keyframe's ``base_link``.
    """

    keyframe: Indices
    position: NDArray[np.float64]

    @classmethod
    def anchored(cls, places: ArrayLike, poses: Poses, keyframe: int | None = None) -> "Places":
        """Anchor places (N, 2 or 3), m in ``map``, to a keyframe, or each to the one that stood nearest.

        ``poses``: of all keyframes, of which there is one at least. Places without height lie at that of
        their keyframe.
        """
        places = np.asarray(places, np.float64)
        owner = np.full(len(places), keyframe, np.int64) if keyframe is not None else nearest(places, poses)
        if places.shape[1:] == (2,):
            places = np.column_stack([places, poses[owner, 2, 3]])
        T = poses[owner]
        return cls(owner, np.einsum("nji,nj->ni", T[:, :3, :3], places.reshape(-1, 3) - T[:, :3, 3]))

    def at(self, poses: Poses) -> NDArray[np.float64]:
        """(N, 3) the places, m in ``map``, with the poses of the keyframes."""
        T = poses[self.keyframe]
        return np.asarray(np.einsum("nij,nj->ni", T[:, :3, :3], self.position) + T[:, :3, 3])

    @classmethod
    def joined(cls, parts: Iterable["Places"]) -> "Places":
        """The places of all parts."""
        parts = [cls(np.zeros(0, np.int64), np.zeros((0, 3))), *parts]
        return cls(np.concatenate([p.keyframe for p in parts]), np.concatenate([p.position for p in parts]))


def nearest(places: NDArray[np.floating], poses: Poses) -> Indices:
    """Number of the keyframe, by their poses, that stood nearest to each place (N, 2 or 3), m in ``map``."""
    return np.asarray(cKDTree(poses[:, :2, 3]).query(places[:, :2])[1], np.int64).reshape(-1)
