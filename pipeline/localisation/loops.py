"""Loops: keyframes that revisit a place whose position was too uncertain to register frames with it directly.

One registration may be wrong: two corners look alike, or a frame shows too little. So a loop counts only if a second
keyframe finds the place where the first one puts it, and if the place then looks as it did before. A loop that other
constraints contradict later is removed.
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
    """A keyframe registered with a place that may be the same.

    Attributes:
        keyframe: its number.
        covariance: of the registration.
        owners: numbers of the keyframes that own the place, the most informative one first.
        T_owner_base: pose relative to each of them, as registered with all.
        shares: pose relative to each of them, by what it owns alone, and its information.
    """

    keyframe: int
    covariance: Covariance
    owners: Indices
    T_owner_base: Poses
    shares: Sequence[tuple[Pose, Information]]

    @classmethod
    def of(cls, keyframe: int, found: Registration, shares: Sequence[Share], poses: Poses) -> "Candidate":
        """A keyframe registered with others, whose ``poses`` may be corrected later."""
        owners = np.array([share.owner for share in shares])
        parts = [(inverse(poses[share.owner]) @ share.T, share.information) for share in shares]
        return cls(keyframe, found.covariance, owners, np.linalg.inv(poses[owners]) @ found.T, parts)

    def T_map_base(self, poses: Poses) -> Pose:
        """Pose of the keyframe by the place, with all keyframes at their ``poses``."""
        return poses[self.owners[0]] @ self.T_owner_base[0]


class Loops:
    """Closes loops of a pose graph, and removes them.

    Attributes:
        closed: those that count.
    """

    def __init__(self, graph: PoseGraph, config: LocalisationConfig) -> None:
        self.closed: list[Loop] = []
        self._graph, self._config, self._lever = graph, config.loops, config.registration.lever
        self._candidate: Candidate | None = None
        self._confirmed: tuple[Candidate, ...] = ()
        self._counted: list[Candidate] = []

    @property
    def is_due(self) -> bool:
        """Whether a loop was confirmed, which the next correction closes."""
        return bool(self._confirmed)

    def propose(self, keyframe: int, found: Registration, shares: Sequence[Share]) -> None:
        """Take the newest keyframe's registration for a loop if it confirms the one proposed before."""
        first = self._candidate
        self._candidate = Candidate.of(keyframe, found, shares, self._graph.poses)
        if first is not None and self._agree(first, self._candidate):
            self._confirmed, self._candidate = (first, self._candidate), None

    def close(self) -> None:
        """Close a confirmed loop; the next optimisation begins where it has the newest poses."""
        graph = self._graph
        for candidate in self._confirmed:
            number, T = candidate.keyframe, candidate.T_map_base(graph.poses)
            for owner, T_owner, (by_owner, information) in zip(
                candidate.owners, candidate.T_owner_base, candidate.shares, strict=True
            ):
                # Not by the owner alone: what it leaves undetermined is meaningless there.
                loop = Loop(int(owner), number, T_owner)
                graph.connect(loop.first, number, graph.poses[owner] @ by_owner, information, loop)
                graph.link(loop.first, number, candidate.covariance)
                self.closed.append(loop)
            self._counted.append(candidate)
            # Started elsewhere, the robust loss would take the loop for an outlier.
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
        """Whether two candidates put their keyframes where the graph has them relative to each other."""
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
    """Share of the points in a frame's view behind which, by ``margin`` m, it has returns; 0 of none.

    At a wrong pose a frame looks through surfaces that were seen. ``T_map_base``: assumed pose of the robot.
    """
    _, z, depth = in_view(frame, T_map_base, points)
    in_reach = (z > frame.sensor.nearest) & (z < frame.sensor.farthest)
    return float(np.mean(depth[in_reach] > z[in_reach] + margin)) if in_reach.any() else 0.0


def in_view(frame: Frame, T_map_base: Pose, points: Places | Points) -> tuple[Indices, Values, Values]:
    """Points in ``map`` that lie in pixels with returns, if a frame was taken at a pose of the robot.

    Returns:
        (N, 2) rows and columns of the pixels; (N,) m along the optical axis to the points, and to the returns.
    """
    in_camera = transform_points(inverse(T_map_base @ frame.T_base_camera), points)
    pixels, inside = frame.intrinsics.project(in_camera)
    pixels, z = pixels[inside], in_camera[inside, 2]
    depth = frame.depth[tuple(pixels.T)]
    return pixels[depth > 0], z[depth > 0], depth[depth > 0]


def looks_the_same(frame: Frame, loop: Pose, before: Pose, points: Places, margin: float) -> bool:
    """Whether a frame looks through no more of a place, by ``margin`` m, at the pose by a loop than before it."""
    return seen_through(frame, loop, points, margin) <= seen_through(frame, before, points, margin)
