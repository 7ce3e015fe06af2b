"""The numbers of localisation."""

from dataclasses import dataclass
from math import radians, tau

from pipeline.localisation.keyframe_policy import KeyframePolicy


@dataclass(frozen=True)
class RegistrationConfig:
    """How frames are turned into clouds, and how clouds are registered.

    Attributes:
        voxel: m; clouds are thinned to the mean of the returns in each voxel.
        limit_pixels: pixels along each side of a square that must not reach the sensor's limit, which cuts off the
            far half of the noise: walls at the limit came 3 cm too near, and floors rose by 1 mm from keyframe to
            keyframe.
        normal_neighbours: number of neighbours from which a point's normal is estimated.
        widest, coarse, fine: m, greatest distances between corresponding points: when starting from a guess alone,
            from odometry, and at the end (two voxels).
        rounds: iterations of a registration at each of these distances.
        least_points: least number of points in the cloud that is registered and in the one that it is registered
            with.
        surface_sigma: m, standard deviation of a pair's distance across its surface. Single points have less noise,
            but it is correlated among the points of one keyframe, with which later ones are registered.
        same_surface: least cosine between the normals of a pair on one surface.
        least_strength: share of the strongest information below which information is taken for noise and left out.
        lever: m, typical distance of what the robot sees; it converts errors of heading into errors of position.
        chance_overlap: share of a frame's points that may fit what was seen before although its pose is wrong: 0.45
            in 281 frames of other places. With less overlap the wheels may have slipped, and a loop is doubtful.
        confidence: probability that the priors accept a correct pose.
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


@dataclass(frozen=True)
class OdometryConfig:
    """The noise of the odometry, and the systematic errors that are expected before the robot drives.

    Attributes:
        gravity_sigma: rad, of a keyframe's roll and pitch: the accelerometer's during a drive.
        turn_sigma, turn_sigma_per_rad: rad, and rad per rad turned, of the heading: the noise of a single motion,
            with the random walk of the gyro's bias. For the simulated gyro 2e-4 was measured.
        way_sigma: m for 1 m driven or 1 rad turned, of the translation of skid-steered wheels, whose errors are a
            random walk: it grows with the root of both. In four simulated arenas 0.004 was measured on level ground.
        least_way: m that a standing robot is assumed to have driven.
        slide_noise: m per rad turned, times the sine of the tilt, of single slides; 0.45 was measured on half ramps.
        slide: m per rad turned and times the sine of the tilt, mean slide downhill of a skid-steered robot on wood.
        way_error_sigma, turn_error_sigma: relative errors of the way and of the turn, by tyres and data sheets of
            gyros.
        centre_sigma: m, centre of turns ahead of ``base_link``.
        slide_sigma: of the mean slide, in its unit.
        bias_sigma: rad/s, error of the yaw rate.
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
        fixed_sigma: rad and m, of a fixed pose: the first keyframe's position and heading, and restored poses.
        least_information: 1/rad² and 1/m², added to each constraint: a plane alone determines only three directions.
        outlier: number of standard deviations beyond which a loop gets less weight (Geman and McClure).
        tolerance: relative decrease of the error below which the optimisation ends; it is small because the
            odometry's errors, each weakly determined, hardly change the sum.
    """

    fixed_sigma: float = 1e-4
    least_information: float = 1e-3
    outlier: float = 3.0
    tolerance: float = 1e-7


@dataclass(frozen=True)
class BeliefConfig:
    """How often the robot's motion goes wrong, and how far a frame shows where the robot is.

    Attributes:
        confidence: probability above which the robot is sure of its state; no single frame can exceed it.
        fault_way: m driven on average between two slips, between two halts and between two losses of sight. In four
            recorded drives there was no slip.
        recovery_way: m, mean length of a slip or a halt as the wheels measure it.
        lift_time: s, mean time between two lifts of the robot; a mission of an hour has at most one.
        tiles: image tiles along a row, whose depths are compared with the map: 1.8° each for the Xtion.
        correlated_tiles: number of tiles that count as one observation, since each is compared with the 3 × 3 around
            it.
        image_share: tiles of an image over the square of the tiles in a row; the aspect ratio is 4:3.
        shown_here, missing_here: probabilities that a tile in which the map expects something shows it, and that it
            has no return, where the robot is where it thinks. In 169 frames 0.99 and 0.01 were measured, and 0.0002
            contradicted, in arenas where nothing changes; tiles without a return come in patches, of what is dark or
            seen at a grazing angle, so they count for less.
        shown_elsewhere, contradicted_elsewhere, missing_elsewhere: probabilities that such a tile shows, contradicts
            or lacks it in a frame of another place, as measured in 281 of them.
        depth_tolerance: m by which a depth may differ from the map's: the diagonal of a voxel, 0.17, and noise.
        pose_error: m by which the camera may be off where a frame is compared with the map.
        ray_step: voxels along the optical axis between the samples of a ray.
        still_way, still_turn: m and rad; if the wheels measure less between two frames, the robot stood still.
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
        reach: m, greatest distance at which loops are searched for, however uncertain the pose is.
        variance_ratio: greatest ratio of the variance after a loop to that before, of the heading or of a horizontal
            direction: a loop must at least halve the deviation.
        pinned_deviation: m; surfaces alone determine the position if their standard deviation of it is smaller.
        seen_through: m; a return this far behind a surface shows that the frame looks through it.
        confirmed_deviation: m, greatest deviation of a keyframe from the one before that confirms its loop.
        contradiction: m; a keyframe that is farther off contradicts a loop, however certain its registration is.
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
    """How frames are localised among keyframes.

    Attributes:
        local_deviation: m; keyframes whose deviation from the newest one is smaller form the local map that frames
            are registered with. The others can only be matched by a loop.
        found_deviation: m, standard deviation of a pose without odometry: where a carried robot was found, or after a
            jump.
        jump: m; odometry that measures more between two keyframes has jumped and is ignored.
        least_extent: m, least size of the map for a robot that may be anywhere in it.
        held_sigma: m, standard deviation of the position of a robot that is held; added to the distance of one that
            slips.
        most_shares: greatest number of keyframes that a new one is connected to; those with the most information are
            chosen.
        same_place_way, same_place_turn: m and rad; a frame that is nearer to a keyframe and shows no more repeats it.
        stopped_way: m; a camera that shows the same image after a longer drive has stopped.
        foot_radius, ground_upward: m, radius of a disc on which the robot stands, and the least upward component of a
            normal of ground.
        ground_sigma: m, of the height of mapped ground under the robot, as measured on half ramps.
        least_ground_points: least number of points of the ground under the robot.
    """

    local_deviation: float = 0.1
    found_deviation: float = 0.1
    jump: float = 1.0
    least_extent: float = 1.0
    held_sigma: float = 0.02
    most_shares: int = 6
    same_place_way: float = 0.3
    same_place_turn: float = radians(15)
    stopped_way: float = 0.05
    foot_radius: float = 0.25
    ground_upward: float = 0.8
    ground_sigma: float = 0.015
    least_ground_points: int = 20


@dataclass(frozen=True)
class RelocalisationConfig:
    """How a carried robot is found in its map.

    Attributes:
        least_frames: least number of frames; one corner of a room looks like another, especially in an incomplete
            map.
        patch: m; the frames' points are thinned to patches of this size, which are searched for in the map.
        searched: number of patches, drawn at random, that the search uses.
        headings: number of headings that are tried, evenly spaced: at 3 m, half a step of 5° moves a point by 0.13 m,
            which a voxel on either side of a surface allows for.
        random_poses: number of random poses by which the probability that a patch meets a surface by chance is
            estimated.
        missed: probability that a patch lies in free space at the right pose, relative to that at a random pose.
        promising: share of the best guess's evidence that another guess needs to be considered: both may be off by
            half a step.
        most_guesses: greatest number of promising guesses; with more, the place is ambiguous.
        same_place_way, same_place_turn: m and rad; guesses that are closer than this count as one.
        registered_voxel: m; the frames' points are thinned to this to register them.
        ground_tolerance: m by which a pose may be above or below the ground.
        surface_tolerance: m, greatest distance between a patch and the surface of the map on which it lies.
        least_explained: least share of what was seen that lies on surfaces of the map.
        rival: greatest likelihood of any other place, relative to the best one.
        correlated_patches: number of patches that count as one observation, because neighbours fit, or fail to fit,
            together.
        drift: m by which the robot may have moved since the first frame: on a slope it slides while it looks around.
        most_uncertain: m, greatest standard deviation of the position of a robot that was found.
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
    """How an RGB-D camera alone measures its motion.

    Attributes:
        guess_sigma: rad and m, standard deviation of the pose of the next frame about a guess.
        image_turn_sigma, image_way_sigma: rad and m, the same about the pose by the images; small, since along a
            plane GICP falsely measures that nothing moves.
        least_overlap: least share of a frame's points that were seen before, unless its image shows the motion.
        most_blind: consecutive frames with too few returns to register and no visual odometry, after which the pose
            is lost.
        kept_way, kept_turn: m and rad between two frames whose points are kept: half the spacing of keyframes, so
            that keyframes find all their surfaces.
        most_corners, least_corners: greatest number of corners, and least number that agree on a motion, as must half
            of all.
        corner_quality: least quality of a corner relative to the strongest.
        corner_spacing: pixels between two corners.
        pixel_error: pixels; greatest error of a corner, both against the motion and after tracking it there and back.
    """

    guess_sigma: float = 0.15
    image_turn_sigma: float = 0.004
    image_way_sigma: float = 0.008
    least_overlap: float = 0.4
    most_blind: int = 30
    kept_way: float = 0.15
    kept_turn: float = radians(7.5)
    most_corners: int = 400
    least_corners: int = 20
    corner_quality: float = 0.01
    corner_spacing: int = 8
    pixel_error: float = 2.0


@dataclass(frozen=True)
class VerticalConfig:
    """How the vertical is estimated from the surfaces in view.

    Attributes:
        stride: pixels from one row and column that is used to the next.
        least_points: least number of returns to find a floor.
        trials: number of RANSAC samples of three points; if a fifth of the points lie on the floor, at least one
            sample lies on it with a probability of 96 %.
        on_floor: number of standard deviations of a depth within which a point lies on the floor.
        steepest: rad, greatest angle between the floor's normal and the image's upward direction.
        least_floor: least share of the returns that lie on the floor.
        least_surfaces: least share of the surfaces that must distinguish the vertical from other directions.
        most_below: greatest share of the returns that lie below the floor; a table has more, because the floor is
            below it.
        below: how many times the distance of ``on_floor`` a point must be under the floor to lie below it.
        first_angle, last_angle: rad; surfaces count if they are this close to horizontal or vertical, in the first
            and in the last rounds (values as published).
        rounds: number of rounds with each.
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
        still_valid: s for which a pose remains valid.
        longest_gap: s between two poses, the longest time over which they are interpolated.
    """

    still_valid: float = 0.02
    longest_gap: float = 0.5


@dataclass(frozen=True)
class PoseCheckConfig:
    """How a doubtful pose is checked.

    Attributes:
        looks: number of views in the full turn that a robot makes when its pose is in doubt.
        carried_way: m; a robot that is found farther than this from its supposed position has been carried.
        carried_turn: rad; the same of its heading.
        blind_turn: rad; a camera that shows nothing during a turn of this size, where the map expects something, is
            broken.
    """

    looks: int = 8
    carried_way: float = 0.3
    carried_turn: float = radians(15)
    blind_turn: float = tau


@dataclass(frozen=True)
class LocalisationConfig:
    """All settings of localisation, one group for each part."""

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
