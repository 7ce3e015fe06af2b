"""Loop closures: keyframes that revisit a place whose position is too uncertain to register frames with it directly.

A single registration may be wrong: two corners look alike, or a frame shows too little. A loop therefore counts only
if a second keyframe finds the place where the first one did, and if the place looks as it did before. A loop is
removed if other constraints contradict it later.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Covariance, Indices, Information, Places, Points, Pose, Poses, Values
from pipeline.frame import Frame
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.gates import chi2_gate
from pipeline.localisation.localisation import Loop
from pipeline.localisation.pose_graph import PoseGraph, spread
from pipeline.localisation.registration import Registration, Share, logarithm
from pipeline.transforms import inverse, transform_points


@dataclass(frozen=True, eq=False)
class Candidate:
    """A keyframe registered with older ones that may have seen the same place.

    Attributes:
        keyframe: index of the keyframe.
        covariance: covariance of the registered pose.
        owners: indices of the older keyframes, the most informative first.
        T_owner_base: pose relative to each older keyframe, as registered with all of them.
        shares: pose relative to each older keyframe, as registered with its points alone, and the pose's information.
    """

    keyframe: int
    covariance: Covariance
    owners: Indices
    T_owner_base: Poses
    shares: Sequence[tuple[Pose, Information]]

    @classmethod
    def of(cls, keyframe: int, found: Registration, shares: Sequence[Share], poses: Poses) -> "Candidate":
        """A keyframe registered with others; ``poses``: current poses of all keyframes, which may change later."""
        owners = np.array([share.owner for share in shares])
        parts = [(inverse(poses[share.owner]) @ share.T, share.information) for share in shares]
        return cls(keyframe, found.covariance, owners, np.linalg.inv(poses[owners]) @ found.T, parts)

    def T_map_base(self, poses: Poses) -> Pose:
        """Pose of the keyframe according to the loop, given the ``poses`` of all keyframes."""
        return poses[self.owners[0]] @ self.T_owner_base[0]


class Loops:
    """Closes loops of a pose graph, and removes wrong ones.

    Attributes:
        closed: the loops that are in the graph.
    """

    def __init__(self, graph: PoseGraph, config: LocalisationConfig) -> None:
        self.closed: list[Loop] = []
        self._graph, self._config, self._lever = graph, config.loops, config.registration.lever
        self._candidate: Candidate | None = None
        self._confirmed: tuple[Candidate, ...] = ()
        self._counted: list[Candidate] = []

    @property
    def is_due(self) -> bool:
        """Whether a loop was confirmed and will be closed by the next correction."""
        return bool(self._confirmed)

    def propose(self, keyframe: int, found: Registration, shares: Sequence[Share]) -> None:
        """Propose the newest keyframe's registration as a loop; it is confirmed if the previous proposal agrees."""
        first = self._candidate
        self._candidate = Candidate.of(keyframe, found, shares, self._graph.poses)
        if first is not None and self._agree(first, self._candidate):
            self._confirmed, self._candidate = (first, self._candidate), None

    def close(self) -> None:
        """Close a confirmed loop, and move the newest poses to where the loop puts them, to optimise from there."""
        graph = self._graph
        for candidate in self._confirmed:
            number, T = candidate.keyframe, candidate.T_map_base(graph.poses)
            for owner, T_owner, (by_owner, information) in zip(
                candidate.owners, candidate.T_owner_base, candidate.shares, strict=True
            ):
                # Use the pose from all owners, since a single owner may leave directions undetermined.
                loop = Loop(int(owner), number, T_owner)
                graph.connect(loop.first, number, graph.poses[owner] @ by_owner, information, loop)
                graph.link(loop.first, number, candidate.covariance)
                self.closed.append(loop)
            self._counted.append(candidate)
            # From another initial value, the robust loss would treat the loop as an outlier.
            graph.poses[number:] = T @ inverse(graph.poses[number]) @ graph.poses[number:]
        self._confirmed = ()

    def take_back(self) -> bool:
        """Remove the loops that the optimised graph contradicts; returns whether there were any."""
        false = [c for c in self._counted if self._is_contradicted(c)]
        for candidate in false:
            self._counted.remove(candidate)
            self._graph.disconnect([loop for loop in self.closed if loop.second == candidate.keyframe])
            self.closed[:] = [loop for loop in self.closed if loop.second != candidate.keyframe]
        return bool(false)

    def _agree(self, first: Candidate, second: Candidate) -> bool:
        """Whether two candidates agree with the graph about the relative pose of their keyframes."""
        poses = self._graph.poses
        deviation = float(self._graph.deviations(second.keyframe)[first.keyframe])
        if deviation >= self._config.confirmed_deviation:
            return False
        T = inverse(first.T_map_base(poses)) @ second.T_map_base(poses)
        off = logarithm(inverse(inverse(poses[first.keyframe]) @ poses[second.keyframe]) @ T)
        covariance = first.covariance + second.covariance + np.diag(spread(deviation, self._lever) ** 2)
        return self._accepts(off, covariance)

    def _is_contradicted(self, candidate: Candidate) -> bool:
        poses = self._graph.poses
        off = logarithm(inverse(candidate.T_map_base(poses)) @ poses[candidate.keyframe])
        allowed = np.diag(spread(self._config.contradiction, self._lever) ** 2) / self._gate(off)
        return not self._accepts(off, candidate.covariance + allowed)

    def _accepts(self, off: Values, covariance: Covariance) -> bool:
        return float(off @ np.linalg.solve(covariance, off)) <= self._gate(off)

    def _gate(self, off: Values) -> float:
        return chi2_gate(len(off), self._config.confidence)


def seen_through(frame: Frame, T_map_base: Pose, points: Places | Points, margin: float) -> float:
    """Share of the points in view that a frame looks through, with a return ``margin`` m behind; 0 without points.

    At a wrong pose, a frame looks through surfaces that were seen. ``T_map_base``: assumed pose of the robot.
    """
    _, z, depth = in_view(frame, T_map_base, points)
    in_reach = (z > frame.sensor.nearest) & (z < frame.sensor.farthest)
    return float(np.mean(depth[in_reach] > z[in_reach] + margin)) if in_reach.any() else 0.0


def in_view(frame: Frame, T_map_base: Pose, points: Places | Points) -> tuple[Indices, Values, Values]:
    """Points in ``map`` that project into pixels with returns, if a frame was taken with the robot at ``T_map_base``.

    Returns:
        (N, 2) row and column of each pixel; (N,) depths of the points and of the returns, m along the optical axis.
    """
    in_camera = transform_points(inverse(T_map_base @ frame.T_base_camera), points)
    pixels, inside = frame.intrinsics.project(in_camera)
    pixels, z = pixels[inside], in_camera[inside, 2]
    depth = frame.depth[tuple(pixels.T)]
    return pixels[depth > 0], z[depth > 0], depth[depth > 0]


def looks_the_same(frame: Frame, loop: Pose, before: Pose, points: Places, margin: float) -> bool:
    """Whether a frame looks through no more points, by ``margin`` m, at a loop's pose than at the one before."""
    return seen_through(frame, loop, points, margin) <= seen_through(frame, before, points, margin)
