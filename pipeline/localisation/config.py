"""Parameters of localisation."""

from dataclasses import dataclass
from math import radians, tau

from pipeline.errors import InputError
from pipeline.localisation.keyframe_policy import KeyframePolicy


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
        least_strength: information below this share of the strongest direction's is treated as noise and left out.
        lever: typical distance of what the robot sees, m; it converts errors of rotation into errors of position.
        chance_overlap: share of a frame's points that may fit earlier points although the pose is wrong; 0.45 was
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
        """Check that a frame is registered at all."""
        if self.rounds < 1:
            raise InputError(f"localisation.registration.rounds = {self.rounds}: must be at least 1")


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


@dataclass(frozen=True)
class PoseGraphConfig:
    """How the pose graph weighs its constraints.

    Attributes:
        fixed_sigma: standard deviation of fixed poses, rad and m: the first keyframe's position and heading, and
            restored poses.
        least_information: added to each constraint, 1/rad² and 1/m²: a plane alone determines only three directions.
        outlier: scale of the Geman-McClure loss, in standard deviations; loops beyond it lose most of their weight.
        tolerance: relative decrease of the error below which the optimisation ends; small because the odometry's
            systematic errors, which are weakly determined, hardly change the sum.
    """

    fixed_sigma: float = 1e-4
    least_information: float = 1e-3
    outlier: float = 3.0
    tolerance: float = 1e-7


@dataclass(frozen=True)
class BeliefConfig:
    """How often the robot's motion goes wrong, and how much a frame says about where the robot is.

    Attributes:
        confidence: probability above which the robot is sure of its state; no single frame makes it surer.
        fault_way: mean distance driven between two slips, m, and likewise between two times that the robot is held,
            and between two losses of sight. No slip occurred in four recorded drives.
        recovery_way: mean length of a slip, or of being held, as the wheels measure it, m.
        lift_time: mean time between two lifts of the robot, s; a mission of an hour has at most one.
        tiles: number of tiles in a row of an image, whose depths are compared with the map: for the Xtion, 1.8° each.
        correlated_tiles: number of tiles that count as one observation, since each is compared in a 3 × 3 window.
        image_share: number of tiles in an image divided by the square of ``tiles``, for an aspect ratio of 4:3.
        shown_here, missing_here: probabilities that a tile for which the map predicts a surface shows it, or has no
            return, if the robot is where it believes to be. In 169 frames of unchanging arenas, 0.99 and 0.01 were
            measured, and 0.0002 of the tiles contradicted the map. Tiles without a return come in patches, where
            surfaces are dark or seen at a grazing angle, so they count for less.
        shown_elsewhere, contradicted_elsewhere, missing_elsewhere: probabilities that such a tile agrees, contradicts
            the map or has no return in a frame taken elsewhere, as measured in 281 such frames.
        depth_tolerance: maximum difference between a measured depth and the map's, m: the diagonal of a voxel, 0.17,
            and noise.
        pose_error: error of the camera's position that is allowed for when a frame is compared with the map, m.
        ray_step: depth between the samples of a ray, in voxels along the optical axis.
        still_way, still_turn: maximum motion that the wheels measure between two frames if they are still, m and rad.
    """

    confidence: float = 0.99
    fault_way: float = 300.0
    recovery_way: float = 1.0
    lift_time: float = 3600.0
    tiles: int = 32
    correlated_tiles: int = 9
    image_share: float = 0.75
    shown_here: float = 0.94
    missing_here: float = 0.05
    shown_elsewhere: float = 0.6
    contradicted_elsewhere: float = 0.2
    missing_elsewhere: float = 0.2
    depth_tolerance: float = 0.2
    pose_error: float = 0.1
    ray_step: float = 0.25
    still_way: float = 0.02
    still_turn: float = radians(2)


@dataclass(frozen=True)
class LoopConfig:
    """When keyframes close a loop.

    Attributes:
        reach: maximum distance at which loops are searched for, m, however uncertain the pose is.
        variance_ratio: maximum ratio of the variance after a loop to that before it, for the heading or a horizontal
            direction: a loop must at least halve one standard deviation.
        pinned_deviation: surfaces alone determine the position if they give it a smaller standard deviation, m.
        seen_through: a frame looks through a surface if it has a return more than this behind it, m.
        confirmed_deviation: maximum standard deviation between two keyframes for one to confirm the other's loop, m.
        contradiction: offset of a keyframe that never contradicts its loop, m, however certain the registration is.
        confidence: probability that a correct loop is accepted.
    """

    reach: float = 1.0
    variance_ratio: float = 0.25
    pinned_deviation: float = 0.1
    seen_through: float = 0.1
    confirmed_deviation: float = 0.1
    contradiction: float = 0.1
    confidence: float = 0.99


@dataclass(frozen=True)
class SlamConfig:
    """How frames are localised relative to keyframes.

    Attributes:
        local_deviation: keyframes with a smaller standard deviation relative to the reference, m, form the local map
            that frames are registered with. The others can only be matched by a loop.
        found_deviation: standard deviation of a pose without odometry, m: where a carried robot was found, or after a
            jump.
        jump: odometry that measures a greater distance since the reference, m, has jumped and is ignored.
        least_extent: minimum size assumed for the map, m, when the robot may be anywhere in it.
        held_sigma: standard deviation of the position of a robot that is held, m; for a robot that slips, it is added
            to the distance driven.
        most_shares: maximum number of keyframes that a new one is connected to; the most informative are chosen.
        stopped_way: a camera that shows the same image after a longer drive, m, has stopped.
        foot_radius, ground_upward: radius of the disc under the robot in which ground is searched for, m, and the
            minimum upward component of a ground normal.
        ground_sigma: standard deviation of the mapped ground's height under the robot, m, as measured on half ramps.
        least_ground_points: minimum number of ground points under the robot.
    """

    local_deviation: float = 0.1
    found_deviation: float = 0.1
    jump: float = 1.0
    least_extent: float = 1.0
    held_sigma: float = 0.02
    most_shares: int = 6
    stopped_way: float = 0.05
    foot_radius: float = 0.25
    ground_upward: float = 0.8
    ground_sigma: float = 0.015
    least_ground_points: int = 20


@dataclass(frozen=True)
class RelocalisationConfig:
    """How a carried robot is found in its map.

    Attributes:
        least_frames: minimum number of frames; one corner of a room looks like another, especially in an incomplete
            map.
        patch: size of a patch, m; the frames' points are thinned to patches, which are matched with the map.
        searched: number of patches that the search uses, drawn at random; also the minimum number of points.
        headings: number of headings that are tried, evenly spaced: at 3 m, half a step of 5° moves a point by 0.13 m,
            which the voxel on either side of a surface allows for.
        random_poses: number of random poses from which the probability is estimated that a patch meets a surface by
            chance.
        missed: probability that a patch lies in free space at the correct pose, relative to that at a random pose.
        promising: a guess is considered if its evidence is more than this share of the best guess's; both may be off
            by half a step.
        most_guesses: maximum number of promising guesses; with more, the place is ambiguous.
        same_place_way, same_place_turn: guesses closer together than this, m and rad, count as one.
        registered_voxel: edge length of the voxels to which the frames' points are thinned for registration, m.
        ground_tolerance: maximum height of a pose above or below the ground, m.
        surface_tolerance: maximum distance from a surface of the map at which a patch lies on it, m.
        least_explained: minimum share of the patches that lie on surfaces of the map.
        rival: maximum likelihood of any other place, relative to the best one.
        correlated_patches: number of patches that count as one observation, because neighbours fit, or fail to fit,
            together.
        drift: standard deviation of the motion since the first frame, m: on a slope, a robot slides as it turns.
        most_uncertain: maximum standard deviation of the position at which a robot is found, m.
    """

    least_frames: int = 3
    patch: float = 0.2
    searched: int = 256
    headings: int = 72
    random_poses: int = 2000
    missed: float = 0.05
    promising: float = 0.7
    most_guesses: int = 12
    same_place_way: float = 0.3
    same_place_turn: float = radians(15)
    registered_voxel: float = 0.1
    ground_tolerance: float = 0.1
    surface_tolerance: float = 0.1
    least_explained: float = 0.85
    rival: float = 1e-4
    correlated_patches: int = 3
    drift: float = 0.1
    most_uncertain: float = 0.05


@dataclass(frozen=True)
class DepthOdometryConfig:
    """How motion is measured with an RGB-D camera alone.

    Attributes:
        guess_sigma: standard deviation of the next frame's pose about a guess, rad and m.
        image_turn_sigma, image_way_sigma: the same about the pose from visual odometry, rad and m; small, because
            along a plane GICP falsely measures no motion.
        least_overlap: minimum share of a frame's points that were seen before, unless its image shows the motion.
        most_blind: maximum number of consecutive frames with too few returns to register and no visual odometry; with
            more, the pose is lost.
        most_corners, least_corners: maximum number of corners, and minimum number that agree on a motion; at least
            half of the tracked corners must agree, too.
        corner_quality: minimum quality of a corner relative to the strongest.
        corner_spacing: minimum distance between two corners, pixels.
        pixel_error: maximum error of a corner, pixels, both against the motion and after tracking it there and back.
    """

    guess_sigma: float = 0.15
    image_turn_sigma: float = 0.004
    image_way_sigma: float = 0.008
    least_overlap: float = 0.4
    most_blind: int = 30
    most_corners: int = 400
    least_corners: int = 20
    corner_quality: float = 0.01
    corner_spacing: int = 8
    pixel_error: float = 2.0


@dataclass(frozen=True)
class VerticalConfig:
    """How the vertical is estimated from the surfaces in view.

    Attributes:
        stride: step between the rows and columns that are used, pixels.
        least_points: minimum number of returns to find a floor.
        trials: number of RANSAC samples of three points; if a fifth of the points lie on the floor, at least one
            sample lies on it with a probability of 96 %.
        on_floor: number of standard deviations of a depth within which a point lies on the floor.
        steepest: maximum angle between the floor's normal and the image's upward direction, rad.
        least_floor: minimum share of the returns that lie on the floor.
        least_surfaces: minimum share of the surfaces that must distinguish the vertical from other directions.
        most_below: maximum share of the returns that lie below the floor; a table has more, because the floor is
            below it.
        below: a point lies below the floor if it is lower by this many times the tolerance of ``on_floor``.
        first_angle, last_angle: surfaces count if they are this close to horizontal or vertical, rad, in the first
            and in the last rounds (values as published).
        rounds: number of rounds with each angle.
    """

    stride: int = 6
    least_points: int = 100
    trials: int = 400
    on_floor: float = 3.0
    steepest: float = radians(60)
    least_floor: float = 0.05
    least_surfaces: float = 0.05
    most_below: float = 0.02
    below: float = 3.0
    first_angle: float = radians(45)
    last_angle: float = radians(15)
    rounds: int = 5


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
        blind_turn: a camera that shows nothing during a turn of this size, rad, although the map predicts returns, is
            broken.
    """

    looks: int = 8
    carried_way: float = 0.3
    carried_turn: float = radians(15)
    blind_turn: float = tau


@dataclass(frozen=True)
class LocalisationConfig:
    """All parameters of localisation, one group per part."""

    registration: RegistrationConfig = RegistrationConfig()
    odometry: OdometryConfig = OdometryConfig()
    graph: PoseGraphConfig = PoseGraphConfig()
    belief: BeliefConfig = BeliefConfig()
    loops: LoopConfig = LoopConfig()
    slam: SlamConfig = SlamConfig()
    relocalisation: RelocalisationConfig = RelocalisationConfig()
    depth_odometry: DepthOdometryConfig = DepthOdometryConfig()
    vertical: VerticalConfig = VerticalConfig()
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
