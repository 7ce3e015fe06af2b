"""The message types of ROS 2, which the package rosbags defines; only the code that handles bags may import them."""

from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
