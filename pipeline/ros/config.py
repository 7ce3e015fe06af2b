"""The numbers of the ROS messages and of robots on a network."""

from dataclasses import dataclass
from math import radians

from pipeline.localisation.config import TrajectoryConfig


@dataclass(frozen=True)
class Nav2Config:
    """Drives by a robot's Nav2 stack.

    Attributes:
        patience: s that a drive may take beyond the time for its way: Nav2 may wait, back up and try again.
        least_speed: m/s, mean over the planned way, below which a drive is given up.
        moved, turned: m and rad by which a goal moves in ``odom``, when the map is corrected, before it is sent anew.
        braking: s that a robot takes to stand, at most.
    """

    patience: float = 30.0
    least_speed: float = 0.05
    moved: float = 0.1
    turned: float = radians(5)
    braking: float = 2.0


@dataclass(frozen=True)
class LiveConfig:
    """Robots on a network.

    Attributes:
        discovery: s within which nodes of one machine discover one another, and acknowledge messages.
        idle: s, the longest time between two calls of a node's ``idle``.
        odometry_queue: messages of a topic that are queued while a program computes: odometry of some seconds.
        queue: messages of a topic that are queued for a listener, as is ROS's default, and images that are kept.
        least_speed, least_turn_rate: m/s and rad/s; a robot may ignore slower commands.
        least_way, least_turn: m and rad by which a robot that follows a command moves at least.
        least_period: s, least control period.
        hold: s of the robot's time without a new command after which it is stopped: the pipeline is computing. A
            frame may be half as much older than the newest odometry.
        starting: messages of odometry from which its period is estimated.
        trajectory: how long odometry is valid.
        nav2: drives by a robot's Nav2 stack.
    """

    discovery: float = 1.0
    idle: float = 0.02
    odometry_queue: int = 100
    queue: int = 10
    least_speed: float = 0.04
    least_turn_rate: float = 0.15
    least_way: float = 0.02
    least_turn: float = radians(3)
    least_period: float = 0.04
    hold: float = 0.2
    starting: int = 5
    trajectory: TrajectoryConfig = TrajectoryConfig()
    nav2: Nav2Config = Nav2Config()


@dataclass(frozen=True)
class RosConfig:
    """What is sent, and robots on a network.

    Attributes:
        cloud_voxel: m, to which clouds are thinned before they are sent.
        live: robots on a network.
    """

    cloud_voxel: float = 0.02
    live: LiveConfig = LiveConfig()
