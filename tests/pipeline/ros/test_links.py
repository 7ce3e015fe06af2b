"""Transforms between the frames of a robot."""

from types import SimpleNamespace as Message

import numpy as np

from pipeline.ros.links import FrameTree


def tree(*links: tuple[str, str, float]) -> FrameTree:
    """Frames that hang on others, so many m along x."""
    made = FrameTree()
    for parent, child, x in links:
        place, turn = Message(x=x, y=0.0, z=0.0), Message(x=0.0, y=0.0, z=0.0, w=1.0)
        header, transform = Message(frame_id=parent), Message(translation=place, rotation=turn)
        made.take(Message(header=header, child_frame_id=child, transform=transform))
    return made


def test_frames_of_one_device_are_known_to_each_other_without_a_robot() -> None:
    found = tree(("device", "imu", 1.0), ("device", "/lens", 3.0), ("lens", "optical", 0.5), ("other", "far", 1.0))
    assert found.T_base("optical") is None
    T = found.between("optical", "imu")
    assert T is not None
    np.testing.assert_allclose(T[:3, 3], [-2.5, 0, 0])
    assert found.between("optical", "far") is None


def test_a_circle_of_frames_ends() -> None:
    found = tree(("a", "b", 1.0), ("b", "a", 1.0), ("base_link", "lens", 2.0))
    assert found.T_base("a") is None
    T = found.T_base("lens")
    assert T is not None
    assert T[0, 3] == 2
