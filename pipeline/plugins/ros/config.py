"""Parameters of ROS messages and of robots on a network."""

from dataclasses import dataclass
from math import radians

from pipeline.localisation.config import TrajectoryConfig


@dataclass(frozen=True)
class Nav2Config:
    """Parameters of drives performed by a robot's Nav2 stack.

    Attributes:
        patience: time that a drive may take in addition to the time for its path, s; Nav2 may wait, back up and try
            again.
        min_speed: assumed minimum of the mean speed along the planned path, m/s, from which the time for the path is
            computed.
        moved, turned: change of a goal in ``odom``, after a correction of the map, beyond which the goal is sent
            again, m and rad.
        braking: maximum time that a robot takes to stop, s.
    """

    patience: float = 30.0
    min_speed: float = 0.05
    moved: float = 0.1
    turned: float = radians(5)
    braking: float = 2.0


@dataclass(frozen=True)
class LiveConfig:
    """Parameters of robots on a network.

    Attributes:
        discovery_timeout: time within which nodes on one machine discover each other and acknowledge messages, s.
        idle: maximum time between two calls of a node's ``on_idle``, s.
        odometry_queue: number of messages that are queued per subscribed topic while the pipeline computes, and
            number of odometry poses that are kept; enough for a few seconds of odometry.
        queue: number of messages that are queued per published topic, and number of images that are kept; the default
            is ROS's.
        min_speed, min_turn_rate: speed and turn rate up to which a robot may ignore commands, m/s and rad/s.
        min_distance, min_turn: minimum motion that shows that a robot follows commands, m and rad.
        min_period: minimum control period, s.
        command_timeout: time on the robot's clock, s, after which a robot is stopped if it gets no new command
            because the pipeline is computing. A frame may be older than the newest odometry by at most half of this
            time.
        starting: number of odometry messages from which their period is estimated.
        trajectory: how long an odometry pose is valid.
        depth_range: nearest and farthest depth that the camera measures, m; by default, the range in the robot's file
            or, if the file gives none, that of the camera that topics or frames name. If they name no camera either,
            an Xtion is assumed, and no returns are left out.
        depth_noise: standard deviation of depth at 1 m, m, which grows with the square of depth; by default, the
            noise of the camera that topics or frames name, or else of an Xtion.
        nav2: parameters of drives performed by a robot's Nav2 stack.
    """

    discovery_timeout: float = 1.0
    idle: float = 0.02
    odometry_queue: int = 100
    queue: int = 10
    min_speed: float = 0.04
    min_turn_rate: float = 0.15
    min_distance: float = 0.02
    min_turn: float = radians(3)
    min_period: float = 0.04
    command_timeout: float = 0.2
    starting: int = 5
    trajectory: TrajectoryConfig = TrajectoryConfig()
    depth_range: tuple[float, float] | None = None
    depth_noise: float | None = None
    nav2: Nav2Config = Nav2Config()


@dataclass(frozen=True)
class RosConfig:
    """Parameters of the messages that are sent, and of robots on a network.

    Attributes:
        cloud_voxel: size of the voxels to which clouds are thinned before they are sent, m.
        live: parameters of robots on a network.
    """

    cloud_voxel: float = 0.02
    live: LiveConfig = LiveConfig()
