"""Names of a robot's topics, in a module of their own, because ``--help`` needs nothing else."""

from dataclasses import dataclass


@dataclass(frozen=True)
class TopicNames:
    """Names of a robot's topics.

    Attributes:
        depth: images in 16UC1 (mm) or 32FC1 (m), raw or compressedDepth, registered to colour.
        color: images, raw or compressed.
        camera_info: of the depth images.
        odom: odometry.
        imu: gyro and accelerometer; without them the tilt is known only by the odometry.
        cmd_vel: commands, Twist or TwistStamped, whichever the robot listens to.
    """

    depth: str = "/camera/depth/image_raw"
    color: str = "/camera/color/image_raw"
    camera_info: str = "/camera/depth/camera_info"
    odom: str = "/odom"
    imu: str = "/imu"
    cmd_vel: str = "/cmd_vel"
