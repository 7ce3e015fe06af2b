"""Simultaneous localisation and mapping: estimates the robot's pose from its frames, its odometry and gravity.

The thesis uses RTAB-Map instead. Each frame is registered with the surfaces that earlier keyframes saw. A frame that
becomes a keyframe is added to a pose graph, with constraints to the keyframes with whose surfaces it was registered.
A loop is closed when the robot returns to keyframes whose relative position is too uncertain to register frames with
them directly.
"""

from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import small_gicp
from scipy.spatial.transform import Rotation

from pipeline.arrays import Covariance, Information, Mask, Places, Points, Pose, Poses, Values
from pipeline.errors import InputError, required
from pipeline.frame import Frame
from pipeline.localisation.belief import Belief, MotionState, bounded_log_likelihoods
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.frame_cloud import cloud_of_frame
from pipeline.localisation.local_map import LocalMap
from pipeline.localisation.localisation import Localisation, LocalisedFrame, LostError, SavedKeyframes, check_odometry
from pipeline.localisation.loops import Candidate, LoopCloser, seen_through_fraction
from pipeline.localisation.motion_model import POSE_SLICE, MeasuredMotion, MotionModel, Prediction
from pipeline.localisation.motion_states import (
    gravity_prior,
    held_and_slipping_priors,
    log_likelihoods,
    register_alternatives,
)
from pipeline.localisation.places import MAX_RANGE, RADIUS, SIGMAS, STEP, find_place
from pipeline.localisation.pose_graph import ConstraintKind, PoseGraph, pose_sigmas
from pipeline.localisation.registration import (
    KeyframeEvidence,
    Prior,
    Registration,
    Surfaces,
    Target,
    evidence_by_keyframe,
    occam_factor,
    register,
)
from pipeline.localisation.unchanged_view import shows_no_motion
from pipeline.transforms import from_rotation, inverse, orthonormal, transform_places

REGISTERED_DEVIATION = 0.01
"""Standard deviation with which surfaces typically determine a pose, m. Surfaces of less certain keyframes have a
lower weight, because registration with them would move the robot instead of the keyframe."""
REGAINED_DEVIATION = 0.3
"""Maximum standard deviation of an old keyframe's position for its surfaces to be registered where more certain ones
are not in view, m. After a blind turn by 100° on a ramp of 15°, 0.12 was measured."""
LOOP_DEVIATION = 0.03
"""Standard deviation of an old surface's position, m, at which it has half its weight in the registration of a loop.
In rc_2015_arena_small, old surfaces were up to 0.1 m apart, which turned a loop by 3°; with weights, by 0.9°. With
0.01 m, a correct loop in a ring of corridors is not closed."""
REPEATED_DEVIATION = 0.03
"""Maximum standard deviation of the robot's position relative to a keyframe for a frame to repeat the keyframe, m."""
FOUND_DEVIATION = 0.1
"""Standard deviation of a pose predicted without odometry, m: where a carried robot was found, or after the odometry
has jumped."""
MIN_MAP_EXTENT = 1.0
"""Minimum size assumed for the map, m, when the robot may be anywhere in it."""
STOPPED_DISTANCE = 0.05
"""Distance driven, m, after which a camera that still returns the same images is assumed to have stopped."""
GROUND_SIGMA = 0.015
"""Standard deviation of the mapped ground's height under the robot, m, as measured on half ramps."""
MAX_REGISTERED = 4000
"""Maximum number of recently seen points that are registered with old ones, drawn at random."""
MAX_HEIGHT_DIFFERENCE = 0.7
"""Maximum difference in height between the robot and an old keyframe with which it may close a loop, m."""
VIEW_STRIDE = 8
"""Step between the pixels of a keyframe's depth image that are kept for finding surfaces through which the keyframe
looked."""
MIN_GROUND_POINTS = 20
"""Minimum number of ground points under the robot."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RegisteredFrame(LocalisedFrame):
    """A frame, its pose, and the data that connect a keyframe made from the frame to others.

    ``prediction`` is None if the odometry cannot be trusted. ``motion_prior`` is the prior of the pose, relative to
    the reference, before the frame was registered; None for the first frame.
    """

    prediction: Prediction | None = None
    motion_prior: Prior | None = None
    cloud: small_gicp.PointCloud | None = None
    target: Target | None = None
    registration: Registration | None = None


@dataclass(frozen=True, eq=False)
class _Reference:
    """The pose from which odometry measures the motion.

    Attributes:
        keyframe: index of the keyframe that the pose is relative to.
        T_keyframe_base: the pose relative to that keyframe.
        time: time of the pose, s.
        T_odom_base: the pose according to odometry.
        covariance: covariance of ``T_keyframe_base``, in its tangent space; 0 for the pose of the keyframe itself.
    """

    keyframe: int
    T_keyframe_base: Pose
    time: float
    T_odom_base: Pose
    covariance: Covariance = field(default_factory=lambda: np.zeros((6, 6)))

    @property
    def is_keyframe(self) -> bool:
        """Whether the reference is the keyframe itself."""
        return np.array_equal(self.T_keyframe_base, np.eye(4))


class Slam(Localisation):
    """Localises frames relative to its keyframes.

    Attributes:
        T_map_odom: pose of ``odom`` in ``map``, from the newest frame.
        graph: pose graph of the keyframes.
        local_map: surfaces that the keyframes saw.
        motion: motion model of the odometry.
        loops: loop closures so far.
        closes_loops: whether loops are closed; False only for comparison.
        on_ground: whether ``base_link`` is on the ground, which is true of a robot but not of a hand-held camera.
        slips: number of frames that showed that the wheels had slipped or spun.
        belief: belief about the robot's motion and position.
    """

    needs_pose_check = True

    def __init__(
        self, closes_loops: bool = True, on_ground: bool = True, *, config: LocalisationConfig = LocalisationConfig()
    ) -> None:
        self._config, self.T_map_odom = config, np.eye(4)
        self.graph = PoseGraph(config)
        self.local_map = LocalMap(config)
        self.motion = MotionModel(config.odometry)
        self._loops = LoopCloser(self.graph, config)
        self.loops = self._loops.closed
        self.closes_loops, self.on_ground = closes_loops, on_ground
        self.slips = 0
        self.belief = Belief(config.belief)
        self._reference = _Reference(-1, np.eye(4), 0.0, np.eye(4))
        self._T_map_found: Pose | None = None  # where a carried robot was found
        self._T_map_odom_anew: Pose | None = None  # since the odometry jumped, or the carried robot was found
        self._deviations = np.zeros(0)
        self._turned = 0.0
        self._last: Frame | None = None
        self._views: list[Frame | None] = []  # each keyframe's reduced frame; None if unknown

    @property
    def poses(self) -> Poses:
        """Current estimate of every keyframe's ``T_map_base``."""
        return self.graph.poses

    @property
    def dropped(self) -> int:
        """Number of constraints that were left out of the graph because they were not finite."""
        return self.graph.dropped

    @property
    def deviations(self) -> Values:
        """(K,) standard deviation of each keyframe's position relative to the reference, m."""
        return self._deviations

    @property
    def T_map_reference(self) -> Pose:
        """Pose of the newest keyframe or of a later frame, from which odometry measures the motion."""
        return self.poses[self._reference.keyframe] @ self._reference.T_keyframe_base

    @property
    def covariance(self) -> Covariance:
        """Covariance of the newest keyframe's pose relative to the first keyframe's."""
        return self.graph.covariance(len(self.graph) - 1)

    def localise(self, frame: Frame) -> RegisteredFrame:
        """Localise a new frame by registration.

        Raises:
            LostError: the odometry or the camera's pose on the robot is not valid, or the camera has stopped.
        """
        check_odometry(frame)
        self._update_motion(frame)
        before, self._last = self._last, frame
        newest = self._find(frame, before)
        self.T_map_odom = newest.T_map_base @ inverse(frame.T_odom_base)
        return replace(newest, repeats=self._repeats(newest))

    def _repeats(self, newest: RegisteredFrame) -> bool:
        """Whether a keyframe at the same pose has seen all that a frame shows."""
        if newest.registration is None or newest.cloud is None or newest.prediction is None:
            return False
        unseen = (1 - newest.registration.overlap) * newest.cloud.size()
        is_small = unseen < self._config.registration.min_points
        return newest.registration.is_sure and is_small and self._repeated_keyframe(newest.T_map_base) is not None

    def add(self, localised: LocalisedFrame) -> None:
        """Make the newest frame, as returned by :meth:`localise`, a keyframe."""
        newest, reference = self._accept(localised), self._reference
        frame, T_map_base, config = newest.frame, newest.T_map_base, self._config
        number = self.graph.add(T_map_base, frame.T_odom_base[2, :3])
        self._views.append(reduced(frame))
        # Connect the keyframe with the reference by the motion between them.
        motion = None
        if newest.motion_prior is not None:
            motion = np.asarray(np.linalg.inv(np.linalg.inv(newest.motion_prior.information) + reference.covariance))
            if newest.prediction is not None and reference.is_keyframe:
                self.graph.add_motion(newest.prediction.motion)
            else:
                self.graph.connect(reference.keyframe, number, newest.motion_prior.T, motion, ConstraintKind.MOTION)
        # Connect it with the keyframes whose surfaces it was registered with, and with the ground that others saw
        # below it.
        new = np.ones(newest.cloud.size() if newest.cloud else 0, np.bool_)
        if newest.target is not None and newest.cloud is not None and (found := newest.registration) is not None:
            evidence, new = evidence_by_keyframe(newest.target, newest.cloud, found.T, config.registration)
            for one in evidence[: config.slam.max_connections]:
                self.graph.connect(one.owner, number, one.T, one.information, ConstraintKind.SURFACE)
        if (stand := self._ground_constraint(T_map_base)) is not None:
            self.graph.connect(stand.owner, number, stand.T, stand.information, ConstraintKind.GROUND)
        # Sample its pose relative to all of them: surfaces seen long ago stay certain as long as they are in view.
        if motion is not None:
            self.graph.extend_samples(reference.keyframe, motion)
        # Keep the surfaces that no other keyframe saw, and measure the next motion from here.
        if newest.cloud is not None:
            self.local_map.add(number, T_map_base, newest.cloud, frame.T_base_camera[:3, 3], new)
        self._set_reference(number, np.eye(4), frame)
        if self.closes_loops:
            self._find_loop(number, newest)

    def continue_without_keyframe(self, localised: LocalisedFrame) -> None:
        """Measure further motions from the newest frame, which repeats a keyframe, without keeping the frame."""
        newest = self._accept(localised)
        number = required(self._repeated_keyframe(localised.T_map_base))
        covariance = self.graph.covariance(number, self._reference.keyframe)
        if newest.registration is not None:
            covariance = covariance + newest.registration.covariance
        self._set_reference(number, inverse(self.poses[number]) @ localised.T_map_base, localised.frame, covariance)

    def _accept(self, newest: LocalisedFrame) -> RegisteredFrame:
        """Accept the newest frame's pose as the start of the next motion."""
        if not isinstance(newest, RegisteredFrame) or newest.frame is not self._last:
            raise ValueError("only the newest frame, as returned by localise, can be a keyframe or be passed by")
        if newest.prediction is not None:
            self.motion.update(newest.prediction, newest.registration.information if newest.registration else None)
        elif newest.registration:
            self.motion.restart(newest.registration.covariance)
        elif newest.motion_prior is not None:
            self.motion.restart(np.asarray(np.linalg.inv(newest.motion_prior.information)))
        return newest

    def _found_sigmas(self) -> Values:
        """(6,) rad and m, standard deviations of a pose predicted without odometry."""
        return pose_sigmas(FOUND_DEVIATION, self._config.registration.typical_range)

    def _set_reference(
        self, keyframe: int, T_keyframe_base: Pose, frame: Frame, covariance: Covariance | float = 0.0
    ) -> None:
        """Measure further motions from a frame, whose pose relative to a keyframe has this ``covariance``."""
        known = np.zeros((6, 6)) + covariance
        self._reference = _Reference(keyframe, T_keyframe_base, frame.time, frame.T_odom_base, known)
        self._T_map_odom_anew, self._turned = None, 0.0
        self._update_deviations()

    def _repeated_keyframe(self, T_map_base: Pose) -> int | None:
        """Index of the nearest keyframe within the spacing of keyframes; None if there is none or it is uncertain."""
        distance, turn = self._config.keyframes.spacing(T_map_base[2, 2])
        way = np.linalg.norm(self.poses[:, :3, 3] - T_map_base[:3, 3], axis=1)
        cosine = (np.einsum("kij,ij->k", self.poses[:, :3, :3], T_map_base[:3, :3]) - 1) / 2
        same = (way < distance) & (cosine > np.cos(turn))
        nearest = int(np.where(same, way, np.inf).argmin())
        return nearest if same.any() and self._deviations[nearest] < REPEATED_DEVIATION else None

    def optimise(self) -> None:
        """Close a loop if one was confirmed, and correct the poses of all keyframes."""
        self._loops.close()
        self.graph.optimise()
        while self._loops.remove_contradicted():
            self.graph.optimise()
        self.motion.learn(self.graph.odometry)
        self.T_map_odom = self.T_map_reference @ inverse(self._reference.T_odom_base)
        self._update_local_map()

    def set_pose(self, T_map_base: Pose) -> None:
        """Continue from the pose at which a carried robot was found, whatever the odometry measured."""
        self._T_map_found, self._last = T_map_base, None
        if len(self.graph):  # nearby keyframes have seen the surfaces in view from there
            nearest = int(np.linalg.norm(self.poses[:, :3, 3] - T_map_base[:3, 3], axis=1).argmin())
            T_keyframe_base = inverse(self.poses[nearest]) @ T_map_base
            self._reference = replace(self._reference, keyframe=nearest, T_keyframe_base=T_keyframe_base)
            self._update_deviations()
        self.belief.restart()

    def points(self) -> Points:
        """Points of the surfaces seen so far."""
        return self.local_map.all_points()

    def keyframes(self) -> SavedKeyframes:
        """All keyframes so far."""
        seen, ups = self.local_map, self.graph.ups.copy()
        return SavedKeyframes(self.poses, ups, seen.points, seen.normals, seen.owner, self.graph.odometry)

    def restore(self, keyframes: SavedKeyframes) -> None:
        """Start with the keyframes of an earlier run, whose poses stay fixed; :meth:`set_pose` sets the robot's pose.

        Raises:
            InputError: the keyframes have no points, because they were not registered.
        """
        if not len(keyframes.points):
            raise InputError("the map has no registered keyframes; use the map of a run with --localisation slam")
        self.graph.fix(keyframes.poses, keyframes.ups, keyframes.odometry)
        self._views = [None] * len(self.graph)
        self.motion.learn(keyframes.odometry)
        self.local_map.restore(keyframes.points, keyframes.normals, keyframes.owner)
        self._reference = _Reference(len(keyframes.poses) - 1, np.eye(4), 0.0, np.eye(4))
        self._update_local_map()

    def _update_motion(self, frame: Frame) -> None:
        """Update the belief for the motion since the last frame, and add up the robot's rotation.

        Between keyframes, the rotation may exceed half a turn, for example when the robot looks around.

        Raises:
            LostError: neither image has changed at all although the robot has moved, so the camera has stopped; noise
                makes all images of a working camera different. Without noise, the depth along a plain corridor stays
                the same, but its colours change.
        """
        if (last := self._last) is None:
            return
        moved = inverse(last.T_odom_base) @ frame.T_odom_base
        way = float(np.linalg.norm(moved[:3, 3]))
        is_same = np.array_equal(last.depth, frame.depth) and np.array_equal(last.rgb, frame.rgb)
        if is_same and frame.returns.any() and way > STOPPED_DISTANCE:
            raise LostError(f"the images at {frame.time:.2f} s equal the previous ones although the robot has moved")
        self._turned += float(Rotation.from_matrix(moved[:3, :3]).as_rotvec() @ frame.T_odom_base[2, :3])
        self.belief.predict(way, max(0.0, frame.time - last.time))

    def _has_jumped(self, before: Frame, frame: Frame) -> bool:
        """Whether the odometry measured over ``jump`` m more between two frames than the robot can have driven."""
        config, moved = self._config.slam, frame.T_odom_base[:3, 3] - before.T_odom_base[:3, 3]
        return bool(np.linalg.norm(moved) > config.jump + config.max_speed * max(0.0, frame.time - before.time))

    @property
    def _is_local(self) -> Mask:
        """Mask of the keyframes whose pose relative to the reference is certain enough for registration."""
        return self._deviations < self._config.slam.local_deviation

    def _update_local_map(self) -> None:
        """Move the surfaces with their keyframes after the keyframes' poses were corrected."""
        self.local_map.apply_poses(self.poses)
        self._update_deviations()

    def _update_deviations(self) -> None:
        """Compute the uncertainty of each keyframe's pose relative to the reference again."""
        self._deviations = self.graph.deviations(self._reference.keyframe)

    def _find(self, frame: Frame, before: Frame | None) -> RegisteredFrame:
        """Localise a frame by registration with the surfaces that earlier keyframes saw around it.

        ``before``: the previous frame; None if there is none, or if the robot was carried after it.
        """
        config = self._config.registration
        # The odometry of the first frame defines the frame ``map``.
        cloud = cloud_of_frame(frame, config)
        if not len(self.graph) and self._T_map_found is None:
            return RegisteredFrame(frame, orthonormal(frame.T_odom_base), cloud=cloud)
        has_jumped = before is not None and self._has_jumped(before, frame)
        if self._T_map_found is not None:
            self._T_map_odom_anew, self._T_map_found = self._T_map_found @ inverse(frame.T_odom_base), None
        elif has_jumped:
            self._T_map_odom_anew = self.T_map_odom @ required(before).T_odom_base @ inverse(frame.T_odom_base)
        first, odometry = self._predict(frame)
        # If the view does not change and shows no surfaces, the wheels spun on the spot. If it shows surfaces, it may
        # also stay the same along a plain corridor.
        if odometry and cloud is None and before is not None and shows_no_motion(before, frame):
            first, _ = held_and_slipping_priors(first, self.T_map_odom @ before.T_odom_base)
            odometry = None
            self.slips += 1
        motion_prior = first
        if odometry and self._reference.is_keyframe:
            motion_prior = Prior(odometry.T_map_base, np.asarray(np.linalg.inv(odometry.motion_covariance)))
        # Where the certain keyframes saw too little, as after a turn without a view, try less certain ones. If these
        # saw too little as well, take the prediction as the pose.
        predicted = RegisteredFrame(frame, first.T, prediction=odometry, motion_prior=motion_prior, cloud=cloud)
        if cloud is None:
            return predicted
        target_of = partial(self._target, cloud.points()[:, :3], first.T, frame, margin=config.widest)
        target = target_of(self._is_local, half=REGISTERED_DEVIATION)
        if is_uncertain := target is None:
            target = target_of(self._deviations < REGAINED_DEVIATION, half=self._config.slam.local_deviation)
        if target is None:
            return predicted
        # Register the frame, with the prediction, gravity and the ground below as priors.
        registered = partial(RegisteredFrame, frame, cloud=cloud, target=target)
        stand = self._ground_constraint(first.T)
        heights = [Prior(stand.T, stand.information)] if stand else []
        level = gravity_prior(first.T, frame, self._config.odometry.gravity_sigma)
        farthest = config.widest if has_jumped or is_uncertain else config.coarse
        nominal = register(target, cloud, [first, level, *heights], farthest, config)
        # Uncertain surfaces must determine the pose by themselves, as for a loop.
        pinned_deviation = self._config.loops.pinned_deviation
        if is_uncertain and not (nominal.is_sure and is_pinned(nominal.information, pinned_deviation)):
            return predicted
        if odometry is None:
            return registered(nominal.T, motion_prior=motion_prior, registration=nominal)
        # If the frame does not fit, also register it as if the robot were held or slipping, and trust the likeliest
        # state.
        found = {MotionState.NOMINAL: (first, nominal)}
        if not nominal.is_sure:
            found |= register_alternatives(target, cloud, first, self.T_map_reference, frame, self._config)
        self.belief.observe(
            self._likelihoods({state: registration for state, (_, registration) in found.items()}, target, frame)
        )
        state = max(found, key=lambda state: self.belief.probabilities[state])
        prior, registration = found[state]
        if state is MotionState.NOMINAL:
            return registered(
                registration.T, prediction=odometry, motion_prior=motion_prior, registration=registration
            )
        self.slips += 1
        return registered(registration.T, motion_prior=prior, registration=registration)

    def _predict(self, frame: Frame) -> tuple[Prior, Prediction | None]:
        """Prior of a frame's pose, and its prediction by the odometry since the reference.

        The prediction is None if the robot was carried since the reference or its odometry has jumped. The prior then
        follows the odometry from the pose at which this happened.
        """
        if self._T_map_odom_anew is not None:
            return Prior(self._T_map_odom_anew @ frame.T_odom_base, np.diag(self._found_sigmas() ** -2.0)), None
        start = self._reference
        T, up = inverse(start.T_odom_base) @ frame.T_odom_base, start.T_odom_base[2, :3]
        motion = MeasuredMotion(T, up, frame.time - start.time, self._turned)
        odometry = self.motion.predict(self.T_map_reference, motion)
        return Prior(
            odometry.T_map_base, np.asarray(np.linalg.inv(odometry.covariance[POSE_SLICE, POSE_SLICE]))
        ), odometry

    def _likelihoods(self, found: dict[MotionState, Registration], target: Target, frame: Frame) -> Values:
        """(5,) log-likelihoods of a frame; ``found``: its registrations with a target, under some of the states."""
        config, likely = self._config, np.full(len(MotionState), -np.inf)
        registrations = list(found.values())
        likely[list(found)] = log_likelihoods(registrations, target, frame, config.registration)
        motion = min(found.values(), key=lambda registration: registration.surprise)
        # If the robot is elsewhere, the frame either fits here by chance, or fits nowhere nearby.
        reach = max(MIN_MAP_EXTENT, float(np.ptp(self.poses[:, :3, 3], axis=0).max()))
        level = gravity_prior(motion.T, frame, config.odometry.gravity_sigma)
        anywhere = level.information + np.diag(np.repeat([np.pi, reach], 3) ** -2.0)
        likely[MotionState.CARRIED] = -min(motion.surprise, occam_factor(anywhere, motion.information))
        return bounded_log_likelihoods(likely, config.belief)

    def _target(
        self, points: Places, T: Pose, frame: Frame, owners: Mask, *, margin: float, half: float
    ) -> Target | None:
        """The old points in view, weighted by the :func:`certainty` of their keyframe's pose."""
        camera = (T @ frame.T_base_camera)[:3, 3]
        weight = certainty(self._deviations, half)
        return self.local_map.around(transform_places(T, points), camera, owners, margin, weight)

    def _ground_constraint(self, T_map_base: Pose) -> KeyframeEvidence | None:
        """The pose, raised or lowered to the ground that earlier keyframes saw below it; None if they saw too little.

        In a narrow place, the camera sees only walls, which do not determine the robot's height.
        """
        heights, owners = self.local_map.ground_below(T_map_base, self._is_local)
        if not self.on_ground or len(heights) < MIN_GROUND_POINTS:
            return None
        lifted = T_map_base @ from_rotation(np.eye(3), np.array([0.0, 0.0, np.median(heights)]))
        information = np.diag([0.0, 0.0, 0.0, 0.0, 0.0, GROUND_SIGMA**-2])
        return KeyframeEvidence(int(np.bincount(owners).argmax()), lifted, information)

    def _find_loop(self, number: int, newest: RegisteredFrame) -> None:
        """Try to locate the newest keyframe among old surfaces whose position relative to it is uncertain."""
        config, loops, poses = self._config.registration, self._config.loops, self.poses
        T, cloud, frame = poses[number], newest.cloud, newest.frame
        if cloud is None or self._loops.is_due:
            return
        # Select the old keyframes that may have seen the robot's surroundings.
        off, far = poses[:, :3, 3] - T[:3, 3], RADIUS + frame.sensor.farthest
        is_near = np.hypot(off[:, 0], off[:, 1]) < far + SIGMAS * self._deviations
        is_near &= np.abs(off[:, 2]) < MAX_HEIGHT_DIFFERENCE + SIGMAS * self._deviations
        old = is_near & ~self._is_local
        if not old.any():
            return
        # Compare all recently seen surfaces with the surfaces of these keyframes, at every pose that the robot may
        # have relative to the latter.
        errors = self.graph.relative_samples(number, np.flatnonzero(old))
        x, y, _ = np.sqrt(np.square(T[:3, :3] @ errors[:, 3:]).mean(axis=2)).max(axis=0)
        sigmas = np.array([x, y, np.sqrt(np.square(errors[:, 2]).mean(axis=1)).max()])
        reach = RADIUS + min(SIGMAS * float(max(x, y)), MAX_RANGE)
        here = T[:3, 3]
        recent, _ = self.local_map.surfaces(here, RADIUS, self._is_local)
        before, owner = self.local_map.surfaces(here, reach, old)
        place = find_place(recent, before, T, sigmas)
        if place is None or place.fit < loops.min_fit or place.rival > loops.rival * place.fit:
            return
        # Register the recent surfaces with the surfaces of the keyframe that saw most of this place, and of keyframes
        # whose position relative to it is certain.
        guess = place.T_move @ T
        near = np.linalg.norm(before.at[:, :2] - guess[:2, 3], axis=1) < RADIUS
        if not near.any():
            return
        first = int(np.bincount(owner[near]).argmax())
        deviations = self.graph.deviations(first)[owner]
        near &= deviations < self._config.slam.local_deviation
        weight = certainty(deviations[near], LOOP_DEVIATION)
        target = Target(before.at[near], before.facing[near], owner[near], weight)
        some = np.random.default_rng(0).permutation(recent.size())[:MAX_REGISTERED]
        source = Surfaces((recent.at[some] - here) @ T[:3, :3], recent.facing[some] @ T[:3, :3])
        if len(target.points) < config.min_points:
            return
        prior = Prior(guess, np.diag(pose_sigmas(2 * STEP, config.typical_range) ** -2.0))
        level = gravity_prior(guess, frame, self._config.odometry.gravity_sigma)
        found = register(target, source, [prior, level], config.coarse, config)
        if not (found.fits and is_pinned(found.information, loops.pinned_deviation)):
            return
        # The new frame must not look through the old surfaces, nor may the old frame look through the new surfaces.
        shown = transform_places(found.T, cloud.points()[:, :3])
        view = self._views[first]
        through = [seen_through_fraction(frame, found.T, target.points, loops.see_through_margin)]
        through += [seen_through_fraction(view, poses[first], shown, loops.see_through_margin)] if view else []
        if max(through) <= loops.max_seen_through:
            registered = np.linalg.inv(found.information + np.eye(6))
            known = registered + np.diag(pose_sigmas(loops.sigma, config.typical_range) ** 2)
            self._loops.propose(Candidate(number, first, inverse(poses[first]) @ found.T, np.asarray(known)))


def certainty(deviations: Values, half: float) -> Values:
    """(N,) weights in registration of surfaces whose position has these standard deviations, m.

    The weight of a certain surface is 1, and the weight at a standard deviation of ``half`` m is 1/2.
    """
    return np.asarray(1 / (1 + np.square(deviations / half)))


def reduced(frame: Frame) -> Frame:
    """A frame reduced to a coarse depth image, without its other images."""
    depth, intrinsics = frame.every_nth(VIEW_STRIDE)
    nothing = np.zeros((*depth.shape, 0), np.uint8)
    return replace(
        frame,
        rgb=nothing,
        depth=depth.astype(np.float16),
        intrinsics=intrinsics,
        label=None,
        instance=None,
        thermal=None,
    )


def is_pinned(information: Information, deviation: float) -> bool:
    """Whether the information determines horizontal position and heading to within ``deviation``, m and rad."""
    covariance = np.linalg.inv(information + np.eye(len(information)))
    return bool(np.linalg.eigvalsh(covariance[2:5, 2:5])[-1] < deviation**2)
