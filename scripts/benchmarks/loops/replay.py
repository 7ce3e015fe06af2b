"""Replay a tour with localisation alone, to obtain its poses, constraints and times."""

from dataclasses import dataclass, field
from time import process_time

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Poses
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.slam import Slam
from pipeline.metric_map.isolated_returns import remove_isolated_returns
from pipeline.transforms import from_yaw
from scripts.benchmarks.localisation_scores import moved_along
from scripts.benchmarks.loops.tours import Tour

CORRECTION_INTERVAL = 3  # Keyframes between two corrections, as between two steps of an episode
POSE_SIGMAS = (0.02, 0.02, 0.0, 0.0, 0.0, 0.005)
"""m and rad, standard deviations of the pose given to a carried robot, in x, y, z, roll, pitch and yaw."""


@dataclass(eq=False)
class TourLocalisation:
    """The results of localisation on a tour.

    Attributes:
        slam: the localisation at the end.
        keyframes: index of the frame of each keyframe.
        online: pose of each frame, as estimated during the tour.
        corrections: for each correction, the index of the newest frame, its pose, and the covariance of this pose.
        frame_s, settle_s: for each frame, and for each correction, the number of keyframes so far and the processor
            time, s.
    """

    slam: Slam
    keyframes: list[int] = field(default_factory=list)
    online: list[NDArray[np.float64]] = field(default_factory=list)
    corrections: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]] = field(default_factory=list)
    frame_s: list[tuple[int, float]] = field(default_factory=list)
    settle_s: list[tuple[int, float]] = field(default_factory=list)

    def poses(self) -> Poses:
        """(N, 4, 4) final pose of each frame: as estimated online, moved along with the keyframe before it."""
        return moved_along(np.array(self.online), self.keyframes, self.slam.poses)


def replay(tour: Tour, config: LocalisationConfig, closes_loops: bool = True) -> TourLocalisation:
    """Localise every frame of a tour; after the robot was carried, the localisation is given an approximate pose."""
    run = TourLocalisation(Slam(closes_loops, config=config))
    slam = run.slam
    rng = np.random.default_rng(0)
    for n, frame in enumerate(tour.frames()):
        frame = remove_isolated_returns(frame)
        if tour.was_carried[n]:
            slam.set_pose(tour.true[n] @ random_pose_error(rng))
        begin = process_time()
        localised = slam.localise(frame)
        if localised.repeats:
            slam.continue_without_keyframe(localised)
        else:
            slam.add(localised)
            run.keyframes.append(n)
        run.frame_s.append((len(slam.graph), process_time() - begin))
        run.online.append(localised.T_map_base)
        if run.keyframes and run.keyframes[-1] == n and len(run.keyframes) % CORRECTION_INTERVAL == 0:
            begin = process_time()
            slam.optimise()
            run.settle_s.append((len(slam.graph), process_time() - begin))
            run.corrections.append((n, slam.poses[-1].copy(), slam.covariance))
    slam.optimise()
    return run


def random_pose_error(rng: np.random.Generator) -> NDArray[np.float64]:
    """A small random transform, the error of the pose given to a robot that was carried."""
    x, y, z, _, _, yaw = rng.normal(size=6) * POSE_SIGMAS
    return from_yaw(x, y, z, yaw)
