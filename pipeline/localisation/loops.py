"""Loop closures: keyframes that revisit a place whose position is too uncertain to register frames with it directly.

A single registration may be wrong, because two corners look alike or a frame shows too little. A loop is therefore
closed only once several keyframes along the path have found the old surfaces in the same place (pairwise consistency;
Mangelson et al., "Pairwise consistent measurement set maximization", 2018). It is removed again if the solved graph
contradicts it, or if it contradicts too many other constraints.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Covariance, Indices, Places, Points, Pose, Poses, Values
from pipeline.frame import Frame
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.gates import chi2_gate
from pipeline.localisation.localisation import Loop
from pipeline.localisation.pose_graph import ConstraintKind, PoseGraph, adjoints, pose_sigmas
from pipeline.localisation.registration import logarithm
from pipeline.transforms import inverse, transform_points


@dataclass(frozen=True, eq=False)
class Candidate:
    """A keyframe that may have returned to the place of an older one.

    Attributes:
        keyframe: index of the keyframe.
        first: index of the older keyframe.
        T_first_base: pose of the keyframe relative to the older one, as registered.
        covariance: covariance of this pose, in its tangent space.
    """

    keyframe: int
    first: int
    T_first_base: Pose
    covariance: Covariance

    def T_map_base(self, poses: Poses) -> Pose:
        """Pose of the keyframe according to the loop, given the ``poses`` of all keyframes."""
        return poses[self.first] @ self.T_first_base


class LoopCloser:
    """Closes loops of a pose graph, and removes wrong ones.

    Attributes:
        closed: the loops that are in the graph.
    """

    def __init__(self, graph: PoseGraph, config: LocalisationConfig) -> None:
        self.closed: list[Loop] = []
        self._graph, self._config, self._typical_range = graph, config.loops, config.registration.typical_range
        self._candidates: list[Candidate] = []
        self._confirmed: list[Candidate] = []
        self._closed_candidates: list[Candidate] = []
        self._fitted = np.zeros(0, np.bool_)

    @property
    def is_due(self) -> bool:
        """Whether a loop was confirmed and will be closed by the next optimisation."""
        return bool(self._confirmed)

    def propose(self, candidate: Candidate) -> None:
        """Propose the newest keyframe's registration as a loop, which is confirmed if enough candidates agree."""
        config, oldest = self._config, candidate.keyframe - self._config.max_candidate_age
        self._candidates = [c for c in self._candidates if c.keyframe >= oldest]
        agree = [c for c in self._candidates if self._agree(c, candidate)]
        disagree = len(self._candidates) - len(agree)
        self._candidates.append(candidate)
        # Neighbouring keyframes see the same surfaces, and the same alias may mislead them, so the robot must have
        # moved between them.
        moved = np.ptp([self._graph.poses[c.keyframe][:3, 3] for c in (*agree, candidate)], axis=0)
        is_enough = 1 + len(agree) >= config.min_agreeing and np.linalg.norm(moved) >= config.min_extent
        if is_enough and disagree <= config.max_disagreeing * len(agree):
            self._confirmed = [*agree, candidate]
            self._candidates.clear()

    def close(self) -> None:
        """Add a confirmed loop to the graph, whose next optimisation closes it."""
        graph = self._graph
        if self._confirmed:
            self._fitted = self._fits()
        for candidate in self._confirmed:
            first, number = candidate.first, candidate.keyframe
            self.closed.append(Loop(first, number, candidate.T_first_base))
            information = np.asarray(np.linalg.inv(candidate.covariance))
            graph.connect(first, number, candidate.T_map_base(graph.poses), information, ConstraintKind.LOOP)
            self._closed_candidates.append(candidate)
            graph.is_unsettled = True

    def remove_contradicted(self) -> bool:
        """Remove the loops that the solved graph contradicts, and return whether there were any.

        However well it fits itself, the newest loop is also removed if too many constraints that fitted before it was
        closed do not fit afterwards.
        """
        false = [c for c in self._closed_candidates if self._is_contradicted(c)]
        if self._confirmed:
            bent = self._fitted & ~self._fits()[: len(self._fitted)]
            if np.count_nonzero(bent) > self._config.max_contradicted:
                false += [c for c in self._confirmed if c not in false]
        self._confirmed = []
        for candidate in false:
            self._closed_candidates.remove(candidate)
            graph = self._graph
            graph.remove((graph.kinds == ConstraintKind.LOOP) & (graph.constraints.second == candidate.keyframe))
            self.closed[:] = [loop for loop in self.closed if loop.second != candidate.keyframe]
        return bool(false)

    def _fits(self) -> NDArray[np.bool_]:
        """(N,) whether the current poses fit each constraint."""
        return self._graph.chi2() <= chi2_gate(6, self._config.confidence)

    def _agree(self, first: Candidate, second: Candidate) -> bool:
        """Whether two candidates agree, given the graph's uncertainty.

        This includes the uncertainty between the two newer keyframes, and between the two older ones.
        """
        graph, poses = self._graph, self._graph.poses
        T = inverse(first.T_map_base(poses)) @ second.T_map_base(poses)
        # All covariances are moved to the tangent space of the second candidate's pose.
        (onward,) = adjoints(inverse(T)[None])
        registered = onward @ first.covariance @ onward.T + second.covariance
        off = logarithm(inverse(inverse(poses[first.keyframe]) @ poses[second.keyframe]) @ T)
        new = graph.covariance(second.keyframe, first.keyframe)
        (back,) = adjoints(inverse(second.T_first_base)[None])
        old = back @ graph.covariance(second.first, first.first) @ back.T
        least = np.diag(pose_sigmas(self._config.tolerance, self._typical_range) ** 2)
        return self._accepts(off, registered + new + old + least)

    def _is_contradicted(self, candidate: Candidate) -> bool:
        poses = self._graph.poses
        off = logarithm(inverse(candidate.T_map_base(poses)) @ poses[candidate.keyframe])
        allowed = np.diag(pose_sigmas(self._config.contradiction, self._typical_range) ** 2) / self._gate(off)
        return not self._accepts(off, candidate.covariance + allowed)

    def _accepts(self, deviation: Values, covariance: Covariance) -> bool:
        return float(deviation @ np.linalg.solve(covariance, deviation)) <= self._gate(deviation)

    def _gate(self, deviation: Values) -> float:
        return chi2_gate(len(deviation), self._config.confidence)


def seen_through_fraction(frame: Frame, T_map_base: Pose, points: Places | Points, margin: float) -> float:
    """Fraction of the points in view with a return more than ``margin`` m behind them; 0 if no points are in view.

    At a wrong pose, a frame looks through known surfaces. ``T_map_base``: assumed pose of the robot.
    """
    _, z, depth = points_in_view(frame, T_map_base, points)
    in_reach = (z > frame.sensor.nearest) & (z < frame.sensor.farthest)
    return float(np.mean(depth[in_reach] > z[in_reach] + margin)) if in_reach.any() else 0.0


def points_in_view(frame: Frame, T_map_base: Pose, points: Places | Points) -> tuple[Indices, Values, Values]:
    """Points in ``map`` that project into pixels with returns, if a frame was taken with the robot at ``T_map_base``.

    Returns:
        (N, 2) row and column of each pixel; (N,) depths of the points and of the returns, m along the optical axis.
    """
    in_camera = transform_points(inverse(T_map_base @ frame.T_base_camera), points)
    pixels, inside = frame.intrinsics.project(in_camera)
    pixels, z = pixels[inside], in_camera[inside, 2]
    is_return = frame.returns[tuple(pixels.T)]
    pixels, z = pixels[is_return], z[is_return]
    return pixels, z, frame.depth[tuple(pixels.T)]
