"""Names of a robot's topics, in a separate module, because ``--help`` needs no other module of this package."""

from dataclasses import dataclass


@dataclass(frozen=True)
class TopicNames:
    """Names of a robot's topics.

    Attributes:
        depth: topic of the depth images: 16UC1 (mm) or 32FC1 (m), raw or compressedDepth. Images that are not
            registered to colour need transforms and a camera_info of the colour images.
        color: topic of the colour images, raw or compressed.
        camera_info: topic of the intrinsics of the depth images.
        odom: topic of the odometry.
        imu: topic of the gyro and accelerometer. Without it, tilt comes from the odometry alone.
        cmd_vel: topic for velocity commands, Twist or TwistStamped, whichever the robot subscribes to.
    """

    depth: str = "/camera/depth/image_raw"
    color: str = "/camera/color/image_raw"
    camera_info: str = "/camera/depth/camera_info"
    odom: str = "/odom"
    imu: str = "/imu"
    cmd_vel: str = "/cmd_vel"
