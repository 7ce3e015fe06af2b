"""Parameters of localisation."""

from dataclasses import dataclass
from math import radians

import numpy as np

from pipeline.arrays import Pose
from pipeline.errors import require_at_least, require_between, require_positive
from pipeline.labels import RAMP_TILT
from pipeline.transforms import angle_of, inverse


@dataclass(frozen=True)
class RegistrationConfig:
    """Settings for converting frames to clouds and for registering the clouds.

    Attributes:
        voxel: edge length of a voxel, m; clouds are thinned to the mean of the returns in each voxel.
        limit_pixels: side, in pixels at half resolution, of the square around a return in which all depths must be
            below the sensor's maximum by more than the standard deviation of the noise there. The maximum cuts off
            the far half of the noise, so walls at this depth would appear 3 cm too near, and floors would rise by
            1 mm per keyframe.
        normal_neighbours: number of neighbours from which a point's normal is estimated.
        widest, coarse, fine: maximum distances between corresponding points, m: at the start from a rough guess, at
            the start from a good one such as the odometry's, and at the end (two voxels).
        iterations: number of iterations at each of these distances.
        min_points: minimum number of points in each of the two clouds that are registered.
        surface_sigma: standard deviation of the distance, perpendicular to the surface, between corresponding points,
            m. Single points are less noisy, but their errors are correlated within each keyframe with which later
            frames are registered.
        min_normal_cosine: minimum cosine between the normals of corresponding points.
        min_strength: minimum information in a direction, as a fraction of the information in the strongest direction;
            less is treated as noise and left out.
        typical_range: typical distance of the surfaces in view, m; converts errors of rotation to errors of position.
        chance_overlap: fraction of a frame's points that may fit earlier points although the pose is wrong; 0.45 was
            measured in 281 frames of other places. With less overlap, the wheels may have slipped.
        confidence: probability that the test against the priors accepts a correct pose.
    """

    voxel: float = 0.05
    limit_pixels: int = 9
    normal_neighbours: int = 20
    widest: float = 0.5
    coarse: float = 0.2
    fine: float = 0.1
    iterations: int = 4
    min_points: int = 100
    surface_sigma: float = 0.063
    min_normal_cosine: float = 0.9
    min_strength: float = 1e-3
    typical_range: float = 2.0
    chance_overlap: float = 0.6
    confidence: float = 0.99

    def __post_init__(self) -> None:
        """Raise InputError if nothing could be registered with these settings."""
        section = "localisation.registration"
        require_positive(section, self, "voxel", "widest", "coarse", "fine", "surface_sigma", "typical_range")
        require_at_least(1, section, self, "limit_pixels", "normal_neighbours", "iterations", "min_points")
        require_between(0, 1, section, self, "chance_overlap", "confidence")


@dataclass(frozen=True)
class OdometryConfig:
    """The noise of the odometry, and its expected systematic errors before the robot has driven.

    Attributes:
        gravity_sigma: standard deviation of the roll and pitch that the accelerometer measures during a drive, rad.
        turn_sigma, turn_sigma_per_rad: standard deviation of the heading after a motion, rad, and its increase per
            rad turned, including the random walk of the gyro's bias. For the simulated gyro, 2e-4 was measured.
        translation_sigma: standard deviation of the measured translation after a skid-steered robot has driven 1 m or
            turned by 1 rad, m. The errors are a random walk, so their variance is proportional to the distance plus
            the angle. On level ground in four simulated arenas, 0.004 was measured.
        added_distance: distance added to every motion when its noise is computed, m, so that the noise is above 0
            even at rest.
        slide_noise: standard deviation of the slide in a single turn from the mean of turns on the same slope, m per
            rad turned, to be multiplied by the sine of the tilt. Changes of pitch count as turns, because the robot
            may drop off an edge. On plain slopes of 3 to 16°, 0.2 was measured; on half ramps, 0.5, because of a few
            turns across their edges.
        slide: mean of each of the three parts of the slide of a skid-steered robot that turns on a slope, m per rad
            turned, to be multiplied by the sine of the tilt. For a Pioneer 3-AT and a Jackal on slopes of 3 to
            16°, 0.29, 0.31 and 0.28 were measured.
        distance_scale_sigma, rotation_scale_sigma: standard deviations of the scale errors (relative errors) of
            distance, caused by the tyres, and of rotation, taken from data sheets of gyros.
        centre_sigma: standard deviation of the distance from ``base_link`` forward to the centre of rotation, m.
        slide_sigma: standard deviation of ``slide``, in the same unit.
        bias_sigma: standard deviation of the yaw rate's bias, rad/s.
        distance_between_slips: mean distance driven between two unnoticed slips, m.
    """

    gravity_sigma: float = radians(0.3)
    turn_sigma: float = 3e-4
    turn_sigma_per_rad: float = 1e-3
    translation_sigma: float = 0.005
    added_distance: float = 0.02
    slide_noise: float = 0.5
    slide: float = 0.3
    distance_scale_sigma: float = 0.02
    rotation_scale_sigma: float = 0.005
    centre_sigma: float = 0.02
    slide_sigma: float = 0.15
    bias_sigma: float = 5e-5
    distance_between_slips: float = 300.0

    def __post_init__(self) -> None:
        """Raise InputError if a standard deviation or distance is out of range."""
        section = "localisation.odometry"
        require_positive(section, self, "gravity_sigma", "turn_sigma", "translation_sigma", "distance_scale_sigma")
        require_positive(section, self, "rotation_scale_sigma", "centre_sigma", "slide_sigma", "bias_sigma")
        require_positive(section, self, "added_distance", "distance_between_slips")
        require_at_least(0, section, self, "turn_sigma_per_rad", "slide_noise")


@dataclass(frozen=True)
class PoseGraphConfig:
    """Settings of the pose graph's optimisation.

    Attributes:
        fixed_sigma: standard deviation of the first keyframe's position and heading, m and rad.
        prior_information: information added to each pose, 1/rad² and 1/m², so that no direction is undetermined.
        tolerance: relative decrease of the error below which the optimisation ends; small because the odometry's
            systematic errors, which are weakly determined, hardly change the error.
        window: number of new keyframes after which the whole graph is solved; until then, only the newest
            ``2 * window`` poses are free. After a loop was closed or removed, or if a motion contradicts the fixed
            poses, the whole graph is solved immediately.
    """

    fixed_sigma: float = 1e-4
    prior_information: float = 1e-3
    tolerance: float = 1e-7
    window: int = 30

    def __post_init__(self) -> None:
        """Raise InputError if the graph could not be solved."""
        require_positive("localisation.graph", self, "fixed_sigma", "prior_information", "tolerance")
        require_at_least(1, "localisation.graph", self, "window")


@dataclass(frozen=True)
class BeliefConfig:
    """Rates at which the motion deviates from the odometry, and the probability required to be sure of a state.

    Attributes:
        confidence: probability above which the robot is sure of its state; no single frame makes the robot surer than
            this.
        distance_between_faults: mean distance driven, m, between two slips, between two occasions on which the robot
            is held, and between two on which its camera sees nothing. No slip occurred in four recorded drives.
        lift_time: mean time between two occasions on which the robot is lifted, s; a mission of an hour has at most
            one.
    """

    confidence: float = 0.99
    distance_between_faults: float = 300.0
    lift_time: float = 3600.0

    def __post_init__(self) -> None:
        """Raise InputError if a rate or an observation's weight would be infinite."""
        require_positive("localisation.belief", self, "distance_between_faults", "lift_time")
        require_between(0.5, 1, "localisation.belief", self, "confidence")


@dataclass(frozen=True)
class LoopConfig:
    """Conditions under which keyframes close a loop.

    Attributes:
        min_fit: minimum fraction of the recently seen surfaces that lie on old ones; surfaces in a voxel next to an
            old one count half.
        rival: maximum fit of any other place, as a fraction of the best place's fit; above it, the place is
            ambiguous.
        pinned_deviation: maximum standard deviation of the horizontal position, m, and heading, rad, that the old
            surfaces determine.
        sigma: additional standard deviation of a loop's registered pose, m, because the relative positions of
            surfaces seen along several metres of path are inexact.
        max_seen_through: maximum fraction of the old points through which the new frame looks, and of the new points
            through which the old frame looked.
        see_through_margin: minimum distance, m, from a surface to a return behind it for the frame to have looked
            through the surface.
        min_agreeing: minimum number of keyframes that find the same place.
        min_extent: minimum diagonal of the box around the positions of the keyframes that find the same place, m.
        max_candidate_age: number of keyframes after which a candidate is discarded.
        max_disagreeing: maximum number of recent candidates that disagree, per candidate that agrees.
        tolerance: standard deviation allowed between two candidates in addition to their own uncertainty, m.
        max_contradicted: maximum number of other constraints that a loop may contradict, such as constraints from
            slipping wheels.
        contradiction: offset, m, up to which a keyframe's pose never contradicts the pose from its loop, however
            certain the registration is.
        confidence: probability that a correct loop is accepted.
    """

    min_fit: float = 0.5
    rival: float = 0.9
    pinned_deviation: float = 0.05
    sigma: float = 0.02
    max_seen_through: float = 0.05
    see_through_margin: float = 0.15
    min_agreeing: int = 3
    min_extent: float = 0.5
    max_candidate_age: int = 20
    max_disagreeing: float = 0.34
    tolerance: float = 0.03
    max_contradicted: int = 4
    contradiction: float = 0.1
    confidence: float = 0.99

    def __post_init__(self) -> None:
        """Raise InputError if no loop could be closed."""
        section = "localisation.loops"
        require_positive(section, self, "min_fit", "pinned_deviation", "sigma", "see_through_margin")
        require_positive(section, self, "tolerance", "contradiction")
        require_at_least(1, section, self, "min_agreeing", "max_candidate_age")
        require_between(0, 1, section, self, "confidence")


@dataclass(frozen=True)
class SlamConfig:
    """Settings for localising frames relative to keyframes.

    Attributes:
        local_deviation: maximum standard deviation, m, of a keyframe's position relative to the reference for the
            keyframe to belong to the local map, with which frames are registered. Other keyframes are matched only by
            loop closures, and where the local map contains too little of what is in view.
        jump: distance between two frames, m, in excess of ``max_speed`` times the time between them, above which the
            odometry is assumed to have jumped and is ignored.
        max_speed: maximum speed of the robot, m/s; a Pioneer 3-AT reaches 0.7 m/s.
        max_connections: maximum number of keyframes to which a new one is connected; the most informative are chosen.
    """

    local_deviation: float = 0.1
    jump: float = 0.5
    max_speed: float = 1.0
    max_connections: int = 6

    def __post_init__(self) -> None:
        """Raise InputError if no frame could be localised with these settings."""
        require_positive("localisation.slam", self, "local_deviation")
        require_at_least(0, "localisation.slam", self, "jump", "max_speed")
        require_at_least(1, "localisation.slam", self, "max_connections")


@dataclass(frozen=True)
class TrajectoryConfig:
    """Periods for which recorded poses are valid.

    Attributes:
        max_time_offset: maximum time before or after a pose at which the pose is used without interpolation, s.
        max_interpolation_gap: maximum time between two poses for a pose between them to be interpolated, s.
    """

    max_time_offset: float = 0.02
    max_interpolation_gap: float = 0.5

    def __post_init__(self) -> None:
        """Raise InputError if a period is negative."""
        require_at_least(0, "localisation.trajectory", self, "max_time_offset", "max_interpolation_gap")


@dataclass(frozen=True)
class PoseCheckConfig:
    """Settings for checking a doubtful pose.

    Attributes:
        views_per_turn: number of views in the full turn that a robot makes when its pose is in doubt.
        min_carried_distance: distance between the estimated and the found position above which the robot is assumed
            to have been carried, m.
        min_carried_turn: angle between the estimated and the found heading above which the robot is assumed to have
            been carried, rad.
    """

    views_per_turn: int = 8
    min_carried_distance: float = 0.3
    min_carried_turn: float = radians(15)

    def __post_init__(self) -> None:
        """Raise InputError if a turn would have too few views to find the robot on the map."""
        require_at_least(3, "localisation.pose_check", self, "views_per_turn")


@dataclass(frozen=True)
class KeyframePolicy:
    """The spacing of keyframes.

    A frame within this spacing of a keyframe repeats the keyframe if the frame shows nothing new.

    Attributes:
        distance: distance from the last keyframe at which a new one is taken, m.
        turn: rotation from the last keyframe at which a new one is taken, rad.
        on_ramps: factor by which both limits are multiplied on ramps, where the robot slides.
        labelled_every: number of keyframes of a drive after which one is labelled, counted from the last labelled
            keyframe; not all are labelled, because the network is the slowest stage.
    """

    distance: float = 0.3
    turn: float = radians(25)
    on_ramps: float = 0.4
    labelled_every: int = 6

    def __post_init__(self) -> None:
        """Raise InputError if keyframes cannot be spaced with these settings."""
        require_positive("localisation.keyframes", self, "distance", "turn", "on_ramps")
        require_at_least(1, "localisation.keyframes", self, "labelled_every")

    def is_due(self, T_odom_keyframe: Pose, T_odom_base: Pose) -> bool:
        """Whether a pose is so far from the last keyframe's that a new keyframe must be taken."""
        moved = inverse(T_odom_keyframe) @ T_odom_base
        distance, turn = self.spacing(min(T_odom_keyframe[2, 2], T_odom_base[2, 2]))
        return bool(np.linalg.norm(moved[:3, 3]) >= distance or angle_of(moved) >= turn)

    def spacing(self, upright: float) -> tuple[float, float]:
        """Distance, m, and rotation, rad, between keyframes of a robot whose tilt has the cosine ``upright``."""
        factor = self.on_ramps if np.arccos(min(upright, 1.0)) > RAMP_TILT else 1.0
        return factor * self.distance, factor * self.turn


@dataclass(frozen=True)
class LocalisationConfig:
    """All parameters of localisation, one group per part."""

    registration: RegistrationConfig = RegistrationConfig()
    odometry: OdometryConfig = OdometryConfig()
    graph: PoseGraphConfig = PoseGraphConfig()
    belief: BeliefConfig = BeliefConfig()
    loops: LoopConfig = LoopConfig()
    slam: SlamConfig = SlamConfig()
    trajectory: TrajectoryConfig = TrajectoryConfig()
    pose_check: PoseCheckConfig = PoseCheckConfig()
    keyframes: KeyframePolicy = KeyframePolicy()
