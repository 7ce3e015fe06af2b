"""Simultaneous localisation and mapping: where the robot is, by its frames, its odometry and gravity.

The thesis leaves this to RTAB-Map. Each frame is registered with the surfaces that earlier keyframes saw, and each
keyframe joins a pose graph, with a constraint to each of those. A loop is closed where the robot comes back to
keyframes whose relative position is too uncertain to register frames with them directly.
"""

from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np
import small_gicp
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from pipeline.errors import InputError
from pipeline.frame import Frame
from pipeline.localisation.belief import ENOUGH_OVERLAP, Belief, MotionState, place_bounded
from pipeline.localisation.local_map import LocalMap
from pipeline.localisation.localisation import (
    KEYFRAME_TURN,
    KEYFRAME_WAY,
    STILL_WAY,
    Localisation,
    Localised,
    LostError,
    SavedKeyframes,
    check_odometry,
)
from pipeline.localisation.loops import KNOWN, Loops, looks_the_same
from pipeline.localisation.motion_model import GRAVITY_SIGMA, POSE, MeasuredMotion, MotionModel, Prediction
from pipeline.localisation.pose_graph import PoseGraph, spread
from pipeline.localisation.registration import (
    CLOUD_VOXEL,
    COARSE,
    LEAST_POINTS,
    NORMAL_NEIGHBOURS,
    WIDEST,
    Prior,
    Registration,
    Share,
    Target,
    cloud_of,
    exponential,
    occam_factor,
    register,
    shares_of,
)
from pipeline.transforms import from_rotation, inverse, orthonormal, transform_points

AROUND = 9
"""Pixels along each side of a square that must not reach the sensor's limit, which cuts off the far half of the
noise: walls at the limit came 3 cm too near, and floors rose by 1 mm from keyframe to keyframe."""
MOST_SHARES = 6
"""Greatest number of keyframes that a new one is connected with: those with the most information."""
FAR_OFF = 1.0
"""m; a loop is sought no farther, however uncertain the pose is, and an odometry that measures more between two
keyframes has jumped and is ignored."""
GROUND_SIGMA = 0.015
"""m, standard deviation of the height of the ground, as known, under the robot, as measured on half ramps."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Match(Localised):
    """A frame, where it was taken, and what the keyframe made of it is connected by.

    ``prediction`` is None if the odometry cannot be trusted. ``step`` is the pose relative to the reference by what
    was known before the frame was registered; None for the first frame.
    """

    prediction: Prediction | None = None
    step: Prior | None = None
    cloud: small_gicp.PointCloud | None = None
    target: Target | None = None
    registration: Registration | None = None


@dataclass(frozen=True, eq=False)
class _Reference:
    """The pose since which the odometry is taken.

    Attributes:
        keyframe: number of the keyframe that it is known relative to.
        T_keyframe_base: 4×4.
        time: s.
        T_odom_base: 4×4 by the odometry.
    """

    keyframe: int
    T_keyframe_base: NDArray[np.float64]
    time: float
    T_odom_base: NDArray[np.float64]

    @property
    def is_keyframe(self) -> bool:
        """Whether it is the pose of the keyframe itself."""
        return np.array_equal(self.T_keyframe_base, np.eye(4))


class Slam(Localisation):
    """Localises frames in the map of its keyframes.

    Attributes:
        T_map_odom: 4×4 pose of ``odom`` in ``map`` by the newest frame.
        graph: pose graph of the keyframes.
        local_map: surfaces that the keyframes saw.
        motion: motion model of the odometry.
        loops: loop closures so far.
        closes_loops: False for comparison only.
        on_ground: whether ``base_link`` is on the ground, as that of a robot is, and that of a camera in a hand not.
        slips: number of frames in which registration showed that wheels slipped or spun.
        belief: of the robot's motion and place.
    """

    may_err = True

    def __init__(self, closes_loops: bool = True, on_ground: bool = True) -> None:
        self.T_map_odom = np.eye(4)
        self.graph = PoseGraph()
        self.local_map = LocalMap()
        self.motion = MotionModel()
        self._loops = Loops(self.graph)
        self.loops = self._loops.closed
        self.closes_loops, self.on_ground = closes_loops, on_ground
        self.slips = 0
        self.belief = Belief()
        self._reference = _Reference(-1, np.eye(4), 0.0, np.eye(4))
        self._anchor: NDArray[np.float64] | None = None
        self._deviations = self._headings = np.zeros(0)
        self._turned = 0.0
        self._last: Frame | None = None

    @property
    def poses(self) -> NDArray[np.float64]:
        """(K, 4, 4) ``T_map_base`` of every keyframe as now estimated."""
        return self.graph.poses

    @property
    def deviations(self) -> NDArray[np.float64]:
        """(K,) m, standard deviation of each keyframe's position relative to the reference."""
        return self._deviations

    @property
    def T_map_reference(self) -> NDArray[np.float64]:
        """4×4 pose since which the odometry is taken: of the newest keyframe, or of a frame passed since."""
        return self.poses[self._reference.keyframe] @ self._reference.T_keyframe_base

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(6, 6) of the newest keyframe's pose relative to the first one's, in its tangent, as optimised last."""
        return self.graph.covariance(len(self.graph) - 1)

    def localise(self, frame: Frame) -> Match:
        """A new frame and where it was taken, by registration.

        Raises:
            LostError: the odometry is not finite, or the camera has stopped.
        """
        check_odometry(frame)
        self._check_camera(frame)
        self._pass_time(frame)
        self._last, match = frame, self._find(frame)
        self.T_map_odom = match.T_map_base @ inverse(frame.T_odom_base)
        return replace(match, repeats=self._repeats(match))

    def _repeats(self, match: Match) -> bool:
        """Whether a keyframe at its pose saw all that a frame shows."""
        if match.registration is None or match.cloud is None or match.prediction is None:
            return False
        unseen = (1 - match.registration.overlap) * match.cloud.size()
        is_sure = match.registration.fits and match.registration.overlap >= ENOUGH_OVERLAP
        return is_sure and unseen < LEAST_POINTS and self._repeated(match.T_map_base) is not None

    def add(self, localised: Localised) -> None:
        """Make a keyframe of the newest frame, as :meth:`localise` gave it."""
        match, reference = self._arrive(localised), self._reference
        frame, T_map_base = match.frame, match.T_map_base
        number = self.graph.add(T_map_base, frame.T_odom_base[2, :3])
        if match.step is not None:
            if match.prediction is not None and reference.is_keyframe:
                self.graph.drive(match.prediction.motion)
            else:
                self.graph.connect(reference.keyframe, number, match.step.T, match.step.information)
            self.graph.link(reference.keyframe, number, np.asarray(np.linalg.inv(match.step.information)))
        new = np.ones(match.cloud.size() if match.cloud else 0, np.bool_)
        if match.target is not None and match.cloud is not None:
            new = self._connect(number, match.cloud, match.target, match.registration)
        if (stand := self._stand(T_map_base)) is not None:
            self.graph.connect(stand.owner, number, stand.T, stand.information)
        if match.cloud is not None:
            self.local_map.add(number, T_map_base, match.cloud, frame.T_base_camera[:3, 3], new)
        self._refer(number, np.eye(4), frame)
        if self.closes_loops:
            self._find_loop(number, match)

    def pass_by(self, localised: Localised) -> None:
        """Take the odometry since the newest frame, which repeats a keyframe, and keep nothing else of it."""
        self._arrive(localised)
        number = self._repeated(localised.T_map_base)
        assert number is not None
        self._refer(number, inverse(self.poses[number]) @ localised.T_map_base, localised.frame)

    def _arrive(self, match: Localised) -> Match:
        """Rely on the newest frame's pose: motions begin there."""
        assert isinstance(match, Match) and match.frame is self._last
        if match.prediction is not None:
            self.motion.take(match.prediction, match.registration.information if match.registration else None)
        elif match.registration:
            self.motion.restart(match.registration.covariance)
        elif len(self.graph):
            self.motion.restart(np.diag(spread(KNOWN) ** 2))
        return match

    def _refer(self, keyframe: int, T_keyframe_base: NDArray[np.float64], frame: Frame) -> None:
        """Take the odometry since a frame, at a 4×4 pose relative to a keyframe."""
        self._reference = _Reference(keyframe, T_keyframe_base, frame.time, frame.T_odom_base)
        self._anchor, self._turned = None, 0.0
        self._judge()

    def _repeated(self, T_map_base: NDArray[np.float64]) -> int | None:
        """Number of the nearest keyframe at the same pose as a 4×4 one; None if there is none, or it is unknown."""
        way = np.linalg.norm(self.poses[:, :3, 3] - T_map_base[:3, 3], axis=1)
        cosine = (np.einsum("kij,ij->k", self.poses[:, :3, :3], T_map_base[:3, :3]) - 1) / 2
        same = (way < KEYFRAME_WAY) & (cosine > np.cos(KEYFRAME_TURN))
        nearest = int(np.where(same, way, np.inf).argmin())
        return nearest if same.any() and self._deviations[nearest] < KNOWN else None

    def optimise(self) -> None:
        """Close a loop if one was confirmed, and correct the poses of all keyframes."""
        self._loops.close()
        self.graph.optimise()
        while self._loops.take_back():
            self.graph.optimise()
        self.motion.learn(self.graph.odometry)
        self.T_map_odom = self.T_map_reference @ inverse(self._reference.T_odom_base)
        self._renew()

    def set_down(self, T_map_base: NDArray[np.float64]) -> None:
        """Continue from the pose (4×4) at which a carried robot was found, whatever the odometry measured."""
        self._anchor, self._last = T_map_base, None
        if len(self.graph):  # what is seen from there belongs to the keyframes near it
            nearest = int(np.linalg.norm(self.poses[:, :3, 3] - T_map_base[:3, 3], axis=1).argmin())
            T_keyframe_base = inverse(self.poses[nearest]) @ T_map_base
            self._reference = replace(self._reference, keyframe=nearest, T_keyframe_base=T_keyframe_base)
            self._judge()
        self.belief.restart()

    def points(self) -> NDArray[np.float32]:
        """(N, 3) float32 points of the surfaces seen so far, m in ``map``."""
        return self.local_map.all_points()

    def keyframes(self) -> SavedKeyframes:
        """All keyframes so far."""
        known = self.local_map
        ups = np.array(self.graph.ups)
        return SavedKeyframes(self.poses, ups, known.points, known.normals, known.owner, self.graph.odometry)

    def restore(self, keyframes: SavedKeyframes) -> None:
        """Begin with the keyframes of an earlier episode, whose poses stay fixed; :meth:`set_down` gives the robot's.

        Raises:
            InputError: the keyframes have no points, for nothing was registered.
        """
        if not len(keyframes.points):
            raise InputError("its episode registered nothing, so no robot finds its place in it")
        self.graph.fix(keyframes.poses, keyframes.ups, keyframes.odometry)
        self.motion.learn(keyframes.odometry)
        known = self.local_map
        known.points, known.normals = keyframes.points.astype(np.float64), keyframes.normals
        known.owner = keyframes.owner
        self._reference = _Reference(len(keyframes.poses) - 1, np.eye(4), 0.0, np.eye(4))
        self._renew()

    def _check_camera(self, frame: Frame) -> None:
        last = self._last
        if last is not None and np.array_equal(last.depth, frame.depth) and frame.returns.any():
            moved = inverse(last.T_odom_base) @ frame.T_odom_base
            # Noise changes every image.
            if np.linalg.norm(moved[:3, 3]) > CLOUD_VOXEL:
                raise LostError(f"the camera has stopped: at {frame.time:.2f} s it shows what it showed before")

    def _pass_time(self, frame: Frame) -> None:
        """Let the belief follow the way since the last frame, and add up the robot's rotation.

        Between keyframes the rotation may exceed half a turn, as when the robot looks around.
        """
        if (last := self._last) is not None:
            moved = inverse(last.T_odom_base) @ frame.T_odom_base
            self._turned += float(Rotation.from_matrix(moved[:3, :3]).as_rotvec() @ frame.T_odom_base[2, :3])
            self.belief.predict(float(np.linalg.norm(moved[:3, 3])), max(0.0, frame.time - last.time))

    def _renew(self) -> None:
        self.local_map.place(self.poses)
        self._judge()

    def _judge(self) -> None:
        """See how sure each keyframe is relative to the reference."""
        self._deviations = self.graph.deviations(self._reference.keyframe)
        self._headings = self.graph.headings(self._reference.keyframe)

    def _find(self, frame: Frame) -> Match:
        cloud = cloud_of_frame(frame)
        if not len(self.graph) and self._anchor is None:
            return Match(frame, orthonormal(frame.T_odom_base), cloud=cloud)
        odometry = self._by_odometry(frame) if self._anchor is None else None
        farthest = COARSE
        if odometry is not None and np.linalg.norm((odometry.T_map_base - self.T_map_reference)[:3, 3]) > FAR_OFF:
            self._anchor, odometry, farthest = self.T_map_reference, None, WIDEST
        first = prior_of(odometry) if odometry else Prior(np.asarray(self._anchor), np.diag(spread(KNOWN) ** -2.0))
        step = self._step(odometry) if odometry else first
        points = cloud.points()[:, :3] if cloud else np.zeros((1, 3))
        target = self._target(points, first.T, frame, self._deviations < KNOWN, WIDEST) if cloud else None
        if target is None:
            return Match(frame, first.T, prediction=odometry, step=step, cloud=cloud)
        registered = partial(Match, frame, cloud=cloud, target=target)
        first = self._relative_to(target, first)
        stand = self._stand(first.T)
        known = [Prior(stand.T, stand.information)] if stand else []
        nominal = register(target, cloud, [first, by_gravity(first.T, frame), *known], farthest)
        if odometry is None:
            return registered(nominal.T, step=step, registration=nominal)
        found = {MotionState.NOMINAL: (first, nominal)}
        if not (nominal.fits and nominal.overlap >= ENOUGH_OVERLAP):
            found |= otherwise(target, cloud, first, self.T_map_reference, frame)
        self.belief.observe(
            self._likelihoods({state: registration for state, (_, registration) in found.items()}, frame)
        )
        state = max(found, key=lambda state: self.belief.probabilities[state])
        prior, registration = found[state]
        if state is MotionState.NOMINAL:
            return registered(registration.T, prediction=odometry, step=step, registration=registration)
        self.slips += 1
        return registered(registration.T, step=prior, registration=registration)

    def _likelihoods(self, found: dict[MotionState, Registration], frame: Frame) -> NDArray[np.float64]:
        """(5,) log-likelihoods of a frame that was registered under some states."""
        told = np.full(len(MotionState), -np.inf)
        for state, registration in found.items():
            told[state] = registration.log_likelihood
        motion = min(found.values(), key=lambda registration: registration.surprise)
        # Elsewhere, either the frame happens to fit here as well, or it fits nowhere near.
        reach = max(FAR_OFF, float(np.ptp(self.poses[:, :3, 3], axis=0).max()))
        anywhere = by_gravity(motion.T, frame).information + np.diag(np.repeat([np.pi, reach], 3) ** -2.0)
        told[MotionState.CARRIED] = -min(motion.surprise, occam_factor(anywhere, motion.information))
        return place_bounded(told)

    def _target(
        self,
        points: NDArray[np.float64],
        T: NDArray[np.float64],
        frame: Frame,
        owners: NDArray[np.bool_],
        margin: float,
    ) -> Target | None:
        camera = (T @ frame.T_base_camera)[:3, 3]
        return self.local_map.around(points @ T[:3, :3].T + T[:3, 3], camera, owners, margin)

    def _by_odometry(self, frame: Frame) -> Prediction:
        """The pose by the odometry since the reference."""
        known = self._reference
        T, up = inverse(known.T_odom_base) @ frame.T_odom_base, known.T_odom_base[2, :3]
        return self.motion.predict(self.T_map_reference, MeasuredMotion(T, up, frame.time - known.time, self._turned))

    def _relative_to(self, target: Target, prior: Prior) -> Prior:
        """A prior of the pose relative to the keyframes that own the target, whose own poses are uncertain.

        Were the heading as uncertain as the position allows, a wall beside the robot would turn it in each frame.
        """
        heading, way = (float(np.median(sigma[target.owner])) for sigma in (self._headings, self._deviations))
        covariance = np.linalg.inv(prior.information) + np.diag(np.repeat([heading, way], 3) ** 2)
        return Prior(prior.T, np.asarray(np.linalg.inv(covariance)))

    def _step(self, odometry: Prediction) -> Prior:
        """The pose by the motion since the reference, as uncertain as it is relative to the reference's keyframe."""
        if not self._reference.is_keyframe:
            return prior_of(odometry)
        return Prior(odometry.T_map_base, np.asarray(np.linalg.inv(odometry.step)))

    def _connect(
        self, number: int, cloud: small_gicp.PointCloud, target: Target, registration: Registration | None
    ) -> NDArray[np.bool_]:
        """Connect a keyframe with those that it was registered with; returns (N,) which of its points are new."""
        assert registration is not None
        shares, new = shares_of(target, cloud, registration.T)
        for share in shares[:MOST_SHARES]:
            self.graph.connect(share.owner, number, share.T, share.information)
            self.graph.link(share.owner, number, registration.covariance)
        return new

    def _stand(self, T_map_base: NDArray[np.float64]) -> Share | None:
        """A 4×4 pose, moved up or down onto the ground that earlier keyframes saw there; None without such ground.

        In a narrow place the camera sees walls alone, which do not tell how high the robot is.
        """
        heights, owners = self.local_map.ground_below(T_map_base, self._deviations < KNOWN)
        if not self.on_ground or len(heights) < NORMAL_NEIGHBOURS:
            return None
        lifted = T_map_base @ from_rotation(np.eye(3), np.array([0.0, 0.0, np.median(heights)]))
        return Share(
            int(np.bincount(owners).argmax()),
            lifted,
            block_diag(np.zeros((3, 3)), np.diag([0.0, 0.0, GROUND_SIGMA**-2])),
        )

    def _find_loop(self, number: int, match: Match) -> None:
        """Register the newest keyframe with those nearby whose relative position is uncertain; one loop at a time."""
        unknown = self._deviations >= KNOWN
        if self._loops.is_due or match.cloud is None or not unknown.any():
            return
        T, reach = self.poses[number], min(float(self._deviations.max()), FAR_OFF)
        target = self._target(match.cloud.points()[:, :3], T, match.frame, unknown, WIDEST + reach)
        if target is None:
            return
        deviation = min(float(self._deviations[np.unique(target.owner)].max()), FAR_OFF)
        prior = Prior(T, np.diag(spread(deviation) ** -2.0))
        found = register(target, match.cloud, [prior, by_gravity(T, match.frame)], max(2 * deviation, COARSE))
        # A loop must at least halve a deviation of the heading or of a horizontal direction.
        horizontal = slice(2, 5)
        level = found.covariance[horizontal, horizontal] * prior.information.diagonal()[horizontal]
        tells = np.linalg.eigvals(level).real.min() < 1 / 2**2
        # Near enough to register from the odometry, a loop may leave a direction to it, as along a corridor.
        is_safe = deviation < COARSE or is_pinned(found.information)
        is_likely = found.overlap >= ENOUGH_OVERLAP and found.fits and tells and is_safe
        if is_likely and looks_the_same(match.frame, found.T, T, target.cloud):
            self._loops.propose(number, found, shares_of(target, match.cloud, found.T)[0][:MOST_SHARES])


def cloud_of_frame(frame: Frame) -> small_gicp.PointCloud | None:
    """The frame's returns in ``base_link``, thinned; None if there are too few."""
    depth = frame.depth[::2, ::2]
    returns = depth > 0
    farthest = frame.sensor.farthest
    returns &= cv2.dilate(depth, np.ones((AROUND, AROUND))) < farthest - frame.sensor.sigma(farthest)
    if np.count_nonzero(returns) < LEAST_POINTS:
        return None
    points = frame.intrinsics.rays[::2, ::2][returns] * depth[returns, None]
    cloud = cloud_of(transform_points(frame.T_base_camera, points))
    return cloud if cloud.size() >= LEAST_POINTS else None


def prior_of(prediction: Prediction) -> Prior:
    """The predicted pose as a Gaussian."""
    return Prior(prediction.T_map_base, np.asarray(np.linalg.inv(prediction.covariance[POSE, POSE])))


def otherwise(
    target: Target, cloud: small_gicp.PointCloud, odometry: Prior, T_map_base: NDArray[np.float64], frame: Frame
) -> dict[MotionState, tuple[Prior, Registration]]:
    """Register a frame as if the robot had stayed at ``T_map_base`` (4×4), or had slipped: by no more than the way.

    A slip is registered from the position before, and from the odometry's.
    """
    stayed = odometry.T.copy()
    stayed[:3, 3] = T_map_base[:3, 3]
    way = STILL_WAY + np.linalg.norm(odometry.T[:3, 3] - stayed[:3, 3])
    rotation = np.linalg.inv(np.linalg.inv(odometry.information)[:3, :3])
    held, slips = (
        Prior(T, block_diag(rotation, np.eye(3) / deviation**2))
        for T, deviation in ((stayed, STILL_WAY), (odometry.T, way))
    )
    begins = (Prior(T, np.zeros_like(slips.information)) for T in (stayed, odometry.T))
    slipped = [register(target, cloud, [begin, slips, by_gravity(slips.T, frame)]) for begin in begins]
    return {
        MotionState.HELD: (held, register(target, cloud, [held, by_gravity(held.T, frame)])),
        MotionState.SLIPPING: (slips, max(slipped, key=lambda registration: registration.log_likelihood)),
    }


def by_gravity(T: NDArray[np.float64], frame: Frame) -> Prior:
    """A prior of roll and pitch alone: the pose ``T`` (4×4), rotated until its vertical is the odometry's."""
    up = frame.T_odom_base[2, :3]
    level = T @ exponential(np.append(np.cross(up, T[2, :3]), np.zeros(3)))
    tilt = (np.eye(3) - np.outer(up, up)) / GRAVITY_SIGMA**2
    return Prior(level, block_diag(tilt, np.zeros((3, 3))))


def is_pinned(information: NDArray[np.float64]) -> bool:
    """Whether (6, 6) information of surfaces alone, 1/rad² and 1/m², determines the position to within ``KNOWN``."""
    covariance = np.linalg.inv(information + np.eye(len(information)))[3:, 3:]
    return bool(np.linalg.eigvalsh(covariance)[-1] < KNOWN**2)
