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
    """How frames are turned into clouds, and how clouds are registered.

    Attributes:
        voxel: edge length of a voxel, m; clouds are thinned to the mean of the returns in each voxel.
        limit_pixels: side of a square of pixels, at half resolution. A return is left out if any depth in the square
            around it reaches the sensor's limit, which cuts off the far half of the noise. Otherwise, walls at the
            limit came out 3 cm too near, and floors rose by 1 mm from keyframe to keyframe.
        normal_neighbours: number of neighbours from which a point's normal is estimated.
        widest, coarse, fine: maximum distances between corresponding points, m: at first when starting from a guess
            alone, at first when starting from odometry, and at the end (two voxels).
        rounds: number of iterations at each of these distances.
        least_points: minimum number of points in the registered cloud and in the one that it is registered with.
        surface_sigma: standard deviation of the distance between a pair's points perpendicular to the surface, m. The
            noise of single points is smaller, but correlated within a keyframe, with which later ones are registered.
        same_surface: minimum cosine between the normals of a pair on one surface.
        least_strength: information below this fraction of the strongest direction's is treated as noise and left out.
        lever: typical distance of what the robot sees, m; it converts errors of rotation into errors of position.
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
    rounds: int = 4
    least_points: int = 100
    surface_sigma: float = 0.063
    same_surface: float = 0.9
    least_strength: float = 1e-3
    lever: float = 2.0
    chance_overlap: float = 0.6
    confidence: float = 0.99

    def __post_init__(self) -> None:
        """InputError if nothing could be registered with these settings."""
        section = "localisation.registration"
        require_positive(section, self, "voxel", "widest", "coarse", "fine", "surface_sigma", "lever")
        require_at_least(1, section, self, "limit_pixels", "normal_neighbours", "rounds", "least_points")


@dataclass(frozen=True)
class OdometryConfig:
    """The noise of the odometry, and the systematic errors that are expected before the robot drives.

    Attributes:
        gravity_sigma: standard deviation of a keyframe's roll and pitch, rad: the accelerometer's during a drive.
        turn_sigma, turn_sigma_per_rad: standard deviation of the heading after a motion, rad, and its increase, rad
            per rad turned, including the random walk of the gyro's bias. For the simulated gyro, 2e-4 was measured.
        way_sigma: standard deviation of the translation of skid-steered wheels after 1 m driven or 1 rad turned, m.
            The errors are a random walk, so it grows with the square root of both. On level ground in four simulated
            arenas, 0.004 was measured.
        least_way: distance added to every motion, m, which gives even a robot at rest some noise.
        slide_noise: standard deviation of a single slide, m per rad turned, multiplied by the sine of the tilt; 0.45
            was measured on half ramps.
        slide: mean downhill slide of a turning skid-steered robot on wood, in the same unit.
        way_error_sigma, turn_error_sigma: standard deviations of the relative errors of distance, due to the tyres,
            and of rotation, from the data sheets of gyros.
        centre_sigma: standard deviation of the distance of the centre of turns ahead of ``base_link``, m.
        slide_sigma: standard deviation of the mean slide, in its unit.
        bias_sigma: standard deviation of the yaw rate's bias, rad/s.
        slip_way: mean distance driven between two slips that go unnoticed, m.
    """

    gravity_sigma: float = radians(0.3)
    turn_sigma: float = 3e-4
    turn_sigma_per_rad: float = 1e-3
    way_sigma: float = 0.005
    least_way: float = 0.02
    slide_noise: float = 0.5
    slide: float = 0.4
    way_error_sigma: float = 0.02
    turn_error_sigma: float = 0.005
    centre_sigma: float = 0.02
    slide_sigma: float = 0.2
    bias_sigma: float = 5e-5
    slip_way: float = 300.0

    def __post_init__(self) -> None:
        """InputError if an error of the odometry is impossible."""
        section = "localisation.odometry"
        require_positive(section, self, "gravity_sigma", "turn_sigma", "way_sigma", "way_error_sigma")
        require_positive(section, self, "turn_error_sigma", "centre_sigma", "slide_sigma", "bias_sigma", "slip_way")
        require_at_least(0, section, self, "turn_sigma_per_rad", "least_way", "slide_noise")


@dataclass(frozen=True)
class PoseGraphConfig:
    """How the pose graph is solved.

    Attributes:
        fixed_sigma: standard deviation of the first keyframe's position and heading, m and rad.
        least_information: added to each pose's information, 1/rad² and 1/m², so that nothing is undetermined.
        tolerance: relative decrease of the error below which the optimisation ends; small because the odometry's
            systematic errors, which are weakly determined, hardly change the sum.
        window: number of new keyframes after which the whole graph is solved; until then, the poses before the
            newest ``2 * window`` keyframes stay. A constraint that contradicts their poses, such as a loop closure,
            solves the whole graph at once.
    """

    fixed_sigma: float = 1e-4
    least_information: float = 1e-3
    tolerance: float = 1e-7
    window: int = 30

    def __post_init__(self) -> None:
        """InputError if the graph could not be solved."""
        require_positive("localisation.graph", self, "fixed_sigma", "least_information", "tolerance")
        require_at_least(1, "localisation.graph", self, "window")


@dataclass(frozen=True)
class BeliefConfig:
    """How often the robot's motion goes wrong.

    Attributes:
        confidence: probability above which the robot is sure of its state; no single frame makes it surer.
        fault_way: mean distance driven between two slips, m, and likewise between two times that the robot is held,
            and between two losses of sight. No slip occurred in four recorded drives.
        lift_time: mean time between two lifts of the robot, s; a mission of an hour has at most one.
    """

    confidence: float = 0.99
    fault_way: float = 300.0
    lift_time: float = 3600.0

    def __post_init__(self) -> None:
        """InputError if a rate would be infinite."""
        require_positive("localisation.belief", self, "fault_way", "lift_time")


@dataclass(frozen=True)
class LoopConfig:
    """When keyframes close a loop.

    Attributes:
        least_fit: minimum fraction of the surfaces seen recently that lie on old ones, as far as these reach.
        rival: maximum fit of any other place, relative to the best one; above it, the place is ambiguous.
        pinned_deviation: the old surfaces must determine position and heading to within this deviation, m and rad.
        sigma: standard deviation of a loop's pose, m, to which that by registration is added: surfaces that were seen
            along some metres of path are not quite rigid.
        most_through: maximum fraction of points that the new frame looks through, or that old frames looked through.
        seen_through: a frame looks through a surface if it has a return more than this behind it, m.
        agreeing: minimum number of keyframes that find the same place.
        apart: minimum distance between the first and the last of these, m.
        remembered: number of keyframes after which a candidate no longer counts.
        most_disagreeing: maximum number of recent candidates that disagree, per candidate that agrees.
        tolerance: allowed for between two candidates besides their uncertainty, m.
        most_bent: maximum number of other constraints that a loop may contradict, as where the wheels have slipped.
        contradiction: offset of a keyframe that never contradicts its loop, m, however certain the registration is.
        confidence: probability that a correct loop is accepted.
    """

    least_fit: float = 0.5
    rival: float = 0.9
    pinned_deviation: float = 0.05
    sigma: float = 0.02
    most_through: float = 0.05
    seen_through: float = 0.15
    agreeing: int = 3
    apart: float = 0.5
    remembered: int = 20
    most_disagreeing: float = 0.34
    tolerance: float = 0.03
    most_bent: int = 4
    contradiction: float = 0.1
    confidence: float = 0.99

    def __post_init__(self) -> None:
        """InputError if no loop could be closed."""
        section = "localisation.loops"
        require_positive(section, self, "least_fit", "pinned_deviation", "sigma", "seen_through")
        require_positive(section, self, "tolerance", "contradiction")
        require_at_least(1, section, self, "agreeing", "remembered")


@dataclass(frozen=True)
class SlamConfig:
    """How frames are localised relative to keyframes.

    Attributes:
        local_deviation: keyframes with a smaller standard deviation relative to the reference, m, form the local map
            that frames are registered with. The others can only be matched by a loop.
        jump: odometry that measures a greater distance since the reference, m, has jumped and is ignored.
        most_shares: maximum number of keyframes that a new one is connected to; the most informative are chosen.
    """

    local_deviation: float = 0.1
    jump: float = 1.0
    most_shares: int = 6


@dataclass(frozen=True)
class TrajectoryConfig:
    """How long a recorded pose is valid.

    Attributes:
        still_valid: maximum time before or after a pose for which it is used without interpolation, s.
        longest_gap: maximum time between two poses that are interpolated, s.
    """

    still_valid: float = 0.02
    longest_gap: float = 0.5


@dataclass(frozen=True)
class PoseCheckConfig:
    """How a doubtful pose is checked.

    Attributes:
        looks: number of views in the full turn that a robot makes when its pose is in doubt.
        carried_way: a robot that is found farther than this from its estimated position was carried, m.
        carried_turn: the same for its heading, rad.
    """

    looks: int = 8
    carried_way: float = 0.3
    carried_turn: float = radians(15)

    def __post_init__(self) -> None:
        """InputError if the robot would not look."""
        require_at_least(1, "localisation.pose_check", self, "looks")


@dataclass(frozen=True)
class KeyframePolicy:
    """How keyframes are spaced.

    A frame closer to a keyframe than this repeats it, if it shows no more.

    Attributes:
        way: distance from the last keyframe at which a new one is due, m.
        turn: rotation from the last keyframe at which a new one is due, rad.
        on_ramps: fraction of both at which a new one is due on a ramp, where the robot slides.
        labelled_every: a keyframe of a drive is labelled only if the number of keyframes before it is a multiple of
            this, because the network is the slowest stage.
    """

    way: float = 0.3
    turn: float = radians(25)
    on_ramps: float = 0.4
    labelled_every: int = 6

    def __post_init__(self) -> None:
        """InputError if keyframes cannot be spaced with these settings."""
        require_positive("localisation.keyframes", self, "way", "turn", "on_ramps")
        require_at_least(1, "localisation.keyframes", self, "labelled_every")

    def is_due(self, T_odom_keyframe: Pose, T_odom_base: Pose) -> bool:
        """Whether a pose is far enough from that of the last keyframe to take a new one."""
        moved = inverse(T_odom_keyframe) @ T_odom_base
        tilt = np.arccos(min(T_odom_keyframe[2, 2], T_odom_base[2, 2], 1.0))
        spacing = self.on_ramps if tilt > RAMP_TILT else 1.0
        return bool(np.linalg.norm(moved[:3, 3]) >= spacing * self.way or angle_of(moved) >= spacing * self.turn)

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
        """Check that odometry is not taken for a jump between two keyframes."""
        way, jump = self.keyframes.way, self.slam.jump
        if not way < jump:
            raise InputError(
                f"localisation.keyframes.way = {way:g}: must be below localisation.slam.jump ({jump:g} m)"
            )
