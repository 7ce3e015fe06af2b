"""Parameters of localisation."""

from dataclasses import dataclass
from math import radians

import numpy as np

from pipeline.arrays import Pose
from pipeline.errors import InputError, require_at_least, require_positive
from pipeline.labels import RAMP_TILT
from pipeline.transforms import angle_of, inverse


@dataclass(frozen=True)
class RegistrationConfig:
    """How frames are converted to clouds, and how clouds are registered.

    Attributes:
        voxel: edge length of a voxel, m; clouds are thinned to the mean of the returns in each voxel.
        limit_pixels: side of a square of pixels, at half resolution. A return is left out if any depth in the square
            around it reaches the sensor's limit, which cuts off the far half of the noise. Otherwise, walls at the
            limit would appear 3 cm too near, and floors would rise by 1 mm from keyframe to keyframe.
        normal_neighbours: number of neighbours from which a point's normal is estimated.
        widest, coarse, fine: maximum distances between corresponding points, m: initially when starting from a guess
            alone, initially when starting from odometry, and finally (two voxels).
        iterations: number of iterations at each of these distances.
        min_points: minimum number of points in each of the two clouds that are registered.
        surface_sigma: standard deviation of the distance between corresponding points perpendicular to the surface,
            m. The noise of single points is smaller, but it is correlated within each keyframe that later frames are
            registered with.
        min_normal_cosine: minimum cosine between the normals of corresponding points.
        min_strength: information in a direction is treated as noise and left out if it is below this fraction of
            that in the strongest direction.
        lever: typical distance of the surfaces in view, m; it converts errors of rotation into errors of position.
        chance_overlap: fraction of a frame's points that may fit earlier points although the pose is wrong; 0.45 was
            measured in 281 frames of other places. With less overlap, the wheels may have slipped, or a loop is
            doubtful.
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
    lever: float = 2.0
    chance_overlap: float = 0.6
    confidence: float = 0.99

    def __post_init__(self) -> None:
        """Raise InputError if nothing could be registered with these settings."""
        section = "localisation.registration"
        require_positive(section, self, "voxel", "widest", "coarse", "fine", "surface_sigma", "lever")
        require_at_least(1, section, self, "limit_pixels", "normal_neighbours", "iterations", "min_points")


@dataclass(frozen=True)
class OdometryConfig:
    """The noise of the odometry, and the systematic errors that are expected before the robot drives.

    Attributes:
        gravity_sigma: standard deviation of a keyframe's roll and pitch, rad, as the accelerometer measures them
            during a drive.
        turn_sigma, turn_sigma_per_rad: standard deviation of the heading after a motion, rad, and its increase, rad
            per rad turned, including the random walk of the gyro's bias. For the simulated gyro, 2e-4 was measured.
        translation_sigma: standard deviation of the measured translation after a skid-steered robot has driven 1 m or
            turned by 1 rad, m. The errors are a random walk, so their variance is proportional to the distance plus
            the angle. On level ground in four simulated arenas, 0.004 was measured.
        added_distance: distance added to every motion, m, so that even the motion of a robot at rest has some noise.
        slide_noise: standard deviation of the slide in a single turn on a slope, m per rad turned; it is multiplied
            by the sine of the tilt. On half ramps, 0.45 was measured.
        slide: mean downhill slide of a turning skid-steered robot on wood, m per rad turned; it is multiplied by the
            sine of the tilt.
        distance_scale_sigma, rotation_scale_sigma: standard deviations of the relative errors (scale errors) of
            distance, due to the tyres, and of rotation, from the data sheets of gyros.
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
    slide: float = 0.4
    distance_scale_sigma: float = 0.02
    rotation_scale_sigma: float = 0.005
    centre_sigma: float = 0.02
    slide_sigma: float = 0.2
    bias_sigma: float = 5e-5
    distance_between_slips: float = 300.0

    def __post_init__(self) -> None:
        """Raise InputError if a standard deviation or distance is out of range."""
        section = "localisation.odometry"
        require_positive(section, self, "gravity_sigma", "turn_sigma", "translation_sigma", "distance_scale_sigma")
        require_positive(section, self, "rotation_scale_sigma", "centre_sigma", "slide_sigma", "bias_sigma")
        require_positive(section, self, "distance_between_slips")
        require_at_least(0, section, self, "turn_sigma_per_rad", "added_distance", "slide_noise")


@dataclass(frozen=True)
class PoseGraphConfig:
    """How the pose graph is solved.

    Attributes:
        fixed_sigma: standard deviation of the first keyframe's position and heading, m and rad.
        prior_information: information added to that of each pose, 1/rad² and 1/m², so that no direction is
            undetermined.
        tolerance: relative decrease of the error below which the optimisation ends; small because the odometry's
            systematic errors, which are weakly determined, hardly change the error.
        window: number of new keyframes after which the whole graph is solved; until then, only the newest
            ``2 * window`` poses are free. If a constraint such as a loop closure contradicts the fixed poses, the
            whole graph is solved at once.
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
    """How often the robot's motion deviates from its odometry, and when the robot is sure of its state.

    Attributes:
        confidence: probability above which the robot is sure of its state; no single frame makes it surer than this.
        distance_between_faults: mean distance driven between two slips, m, and likewise between two occasions on
            which the robot is held or its camera sees nothing. No slip occurred in four recorded drives.
        lift_time: mean time between two occasions on which the robot is lifted, s; a mission of an hour has at most
            one.
    """

    confidence: float = 0.99
    distance_between_faults: float = 300.0
    lift_time: float = 3600.0

    def __post_init__(self) -> None:
        """Raise InputError if a rate would be infinite."""
        require_positive("localisation.belief", self, "distance_between_faults", "lift_time")


@dataclass(frozen=True)
class LoopConfig:
    """When keyframes close a loop.

    Attributes:
        min_fit: minimum fraction of the recently seen surfaces that lie on old ones; surfaces in a voxel next to an
            old one count half.
        rival: maximum fit of any other place, relative to that of the best one; above it, the place is ambiguous.
        pinned_deviation: maximum standard deviation of the horizontal position and heading, m and rad, as the old
            surfaces determine them.
        sigma: standard deviation of a loop's pose in addition to that of its registration, m, because surfaces that
            were seen along several metres of path are not quite rigid.
        max_seen_through: maximum fraction of the old points that the new frame looks through, and of the new points
            that the old frame looked through.
        see_through_margin: a frame looks through a surface if its return is more than this distance behind it, m.
        agreeing: minimum number of keyframes that find the same place.
        apart: minimum diagonal of the box around the positions of the keyframes that find the same place, m.
        max_candidate_age: number of keyframes after which a candidate is discarded.
        max_disagreeing: maximum number of recent candidates that disagree, per candidate that agrees.
        tolerance: standard deviation that is allowed between two candidates in addition to their own uncertainty, m.
        max_contradicted: maximum number of other constraints that a loop may contradict, such as those of slipping
            wheels.
        contradiction: offset between a keyframe and its loop, m, that is never a contradiction, however certain the
            registration is.
        confidence: probability that a correct loop is accepted.
    """

    min_fit: float = 0.5
    rival: float = 0.9
    pinned_deviation: float = 0.05
    sigma: float = 0.02
    max_seen_through: float = 0.05
    see_through_margin: float = 0.15
    agreeing: int = 3
    apart: float = 0.5
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
        require_at_least(1, section, self, "agreeing", "max_candidate_age")


@dataclass(frozen=True)
class SlamConfig:
    """How frames are localised relative to keyframes.

    Attributes:
        local_deviation: maximum standard deviation of a keyframe's position relative to the reference, m, for it to
            belong to the local map that frames are registered with. Other keyframes are matched only by loop
            closures.
        jump: distance since the reference above which the odometry has jumped and is ignored, m.
        max_connections: maximum number of keyframes that a new one is connected to; the most informative are chosen.
    """

    local_deviation: float = 0.1
    jump: float = 1.0
    max_connections: int = 6


@dataclass(frozen=True)
class TrajectoryConfig:
    """How long a recorded pose is valid.

    Attributes:
        max_time_offset: maximum time before or after a pose at which the pose is used without interpolation, s.
        longest_gap: maximum time between two poses that are interpolated, s.
    """

    max_time_offset: float = 0.02
    longest_gap: float = 0.5


@dataclass(frozen=True)
class PoseCheckConfig:
    """How a doubtful pose is checked.

    Attributes:
        views_per_turn: number of views in the full turn that a robot makes when its pose is in doubt.
        carried_way: minimum distance between the estimated and the found position of a robot that was carried, m.
        carried_turn: minimum angle between the estimated and the found heading of a robot that was carried, rad.
    """

    views_per_turn: int = 8
    carried_way: float = 0.3
    carried_turn: float = radians(15)

    def __post_init__(self) -> None:
        """Raise InputError if the robot would not look around."""
        require_at_least(1, "localisation.pose_check", self, "views_per_turn")


@dataclass(frozen=True)
class KeyframePolicy:
    """How keyframes are spaced.

    A frame within this spacing of a keyframe repeats the keyframe if it shows nothing new.

    Attributes:
        distance: distance from the last keyframe at which a new one is taken, m.
        turn: rotation from the last keyframe at which a new one is taken, rad.
        on_ramps: fraction of both limits at which a new keyframe is taken on a ramp, where the robot slides.
        labelled_every: interval between the labelled keyframes of a drive, in keyframes; not all are labelled,
            because the network is the slowest stage.
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
        """Whether a pose is far enough from that of the last keyframe to take a new one."""
        moved = inverse(T_odom_keyframe) @ T_odom_base
        tilt = np.arccos(min(T_odom_keyframe[2, 2], T_odom_base[2, 2], 1.0))
        spacing = self.on_ramps if tilt > RAMP_TILT else 1.0
        return bool(np.linalg.norm(moved[:3, 3]) >= spacing * self.distance or angle_of(moved) >= spacing * self.turn)

    def is_labelled(self, keyframes: int) -> bool:
        """Whether the next keyframe of a drive is labelled, given the number of ``keyframes`` before it."""
        return keyframes % self.labelled_every == 0


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

    def __post_init__(self) -> None:
        """Raise InputError if the motion between two keyframes would be taken for a jump of the odometry."""
        distance, jump = self.keyframes.distance, self.slam.jump
        if not distance < jump:
            raise InputError(
                f"localisation.keyframes.distance = {distance:g}: must be below localisation.slam.jump ({jump:g} m)"
            )
