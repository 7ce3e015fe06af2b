"""Transforms between the frames of a robot."""

from types import SimpleNamespace as Message

import numpy as np
import pytest

from pipeline.datasets.links import FrameTree, tf_topics


def tree(*links: tuple[str, str, float]) -> FrameTree:
    """Frames that hang on others, so many m along x; a second link of a frame moves it."""
    made = FrameTree()
    for link in links:
        take(made, *link)
    return made


def take(made: FrameTree, parent: str, child: str, x: float, w: float = 1.0) -> None:
    """Let a tree take a transform whose quaternion is 0 0 0 ``w``."""
    place, turn = Message(x=x, y=0.0, z=0.0), Message(x=0.0, y=0.0, z=0.0, w=w)
    header, transform = (
        Message(frame_id=parent, stamp=Message(sec=0, nanosec=0)),
        Message(translation=place, rotation=turn),
    )
    made.take(Message(header=header, child_frame_id=child, transform=transform))


def test_frames_of_one_device_are_known_to_each_other_without_a_robot() -> None:
    found = tree(("device", "imu", 1.0), ("device", "/lens", 3.0), ("lens", "optical", 0.5), ("other", "far", 1.0))
    assert found.mount("optical").T_base_camera is None
    T = found.between("optical", "imu")
    assert T is not None
    np.testing.assert_allclose(T[:3, 3], [-2.5, 0, 0])
    assert found.between("optical", "far") is None


def test_a_circle_of_frames_ends() -> None:
    found = tree(("a", "b", 1.0), ("b", "a", 1.0), ("base_link", "lens", 2.0))
    assert found.mount("a").T_base_camera is None
    T = found.mount("lens").T_base_camera
    assert T is not None
    assert T[0, 3] == 2


@pytest.mark.parametrize(
    ("links", "driven", "height", "ground"),
    [
        ([("base_link", "base_footprint", -0.5), ("base_link", "lens", 2.0)], "base_link", 2.5, -0.5),
        ([("base_footprint", "base_link", 0.5), ("base_link", "lens", 2.0)], "base_link", 2.5, -0.5),
        ([("base_footprint", "base_link", 0.5), ("base_link", "lens", 2.0)], "base_footprint", 2.5, 0),
        ([("r/base_link", "r/base_footprint", -0.5), ("r/base_link", "lens", 2.0)], "r/base_link", 2.5, -0.5),
        ([("base_link", "base_footprint", -0.5), ("base_link", "base_footprint", -0.6), ("base_link", "lens", 2.0)],
         "base_link", 2, 0),
    ],
)  # fmt: skip
def test_a_robots_place_is_that_of_its_footprint_on_the_ground(
    links: list[tuple[str, str, float]], driven: str, height: float, ground: float
) -> None:
    found = tree(*links)
    found.base = driven
    T, T_driven_base, note = found.mount("lens")
    assert T is not None and not note
    assert (T[0, 3], T_driven_base[0, 3]) == pytest.approx((height, ground))


ODOM = ("odom", "base_link", 5.0), ("odom", "base_link", 6.0)


@pytest.mark.parametrize(
    ("links", "driven", "camera", "x", "said"),
    [
        ([*ODOM, ("base_link", "lens", 2.0)], "base_link", "lens", 2, []),
        ([*ODOM, ("base_link", "lens", 2.0)], "", "lens", 2, []),
        ([("base_footprint", "base_link", 0.5), ("base_link", "lens", 2.0)], "base_footprint", "lens", 2.5, []),
        ([("base_link", "base_footprint", -0.5), ("base_link", "lens", 2.0)], "base_footprint", "lens", 2.5, []),
        ([("r/odom", "r/base", 5.0), ("r/odom", "r/base", 6.0), ("r/base", "r/lens", 2.0)], "", "r/lens", 2, []),
        ([("base_link", "lens", 2.0)], "base_footprint", "lens", 2, ["base_link", "base_footprint"]),
        ([("base_footprint", "lens", 2.0)], "", "lens", 2, ["base_footprint", "base_link"]),
        ([("r1/base_link", "r1/lens", 2.0)], "base_link", "lens", 2, ["r1/base_link", "r1/lens"]),
        ([("r1_base_link", "arm_base_link", 1.0), ("arm_base_link", "lens", 1.0)], "", "lens", 2, ["r1_base_link"]),
        ([("base_link", "pan", 1.0), ("base_link", "pan", 2.0), ("pan", "lens", 1.0)], "", "lens", 3, ["pan moves"]),
        ([*ODOM, ("base_link", "mast", 2.0)], "base_link", "lens", None, ["base_link", "lens", "mast"]),
        ([*ODOM, ("odom", "lens", 2.0)], "base_link", "lens", None, ["base_link", "lens", "odom"]),
        ([("a/base_link", "a/lens", 1.0), ("b/base_link", "b/lens", 2.0)], "", "lens", None, ["a/lens", "b/lens"]),
        ([], "", "", None, ["base_link", "none"]),
    ],
)  # fmt: skip
def test_a_camera_is_found_on_the_robot_and_what_was_assumed_is_said(
    links: list[tuple[str, str, float]], driven: str, camera: str, x: float | None, said: list[str]
) -> None:
    found = tree(*links)
    found.base = driven
    T, _, note = found.mount(camera)
    assert T is None if x is None else T is not None and T[0, 3] == pytest.approx(x)
    assert bool(note) == bool(said) and all(word in note for word in said)


def test_the_odometry_is_that_of_the_robot_with_the_camera() -> None:
    links = [(f"r{k}/odom", f"r{k}/base_link", float(k)) for k in (1, 2)]
    found = tree(*links, *((f"r{k}/base_link", f"r{k}/lens", 1.0) for k in (1, 2)))
    assert [T[0, 3] for _, T in found.odometry("r2/lens")] == [2]
    assert found.odometry("nowhere") == []
    assert [T[0, 3] for _, T in tree(links[0]).odometry("nowhere")] == [1]


@pytest.mark.parametrize(
    ("topics", "robot_topic", "expected"),
    [
        (["/tf", "/tf_static"], "/camera/depth", ["/tf", "/tf_static"]),
        (["/r1/tf", "/r1/tf_static"], "/r1/camera/depth", ["/r1/tf", "/r1/tf_static"]),
        (["/r1/tf", "/r1/tf_static"], "/camera/depth", ["/r1/tf", "/r1/tf_static"]),
        (["/tf", "/r1/tf", "/r2/tf"], "/r2/camera/depth", ["/tf", "/r2/tf"]),
        (["/r1/tf", "/r10/tf"], "/r10/camera/depth", ["/r10/tf"]),
        (["/r1/tf", "/r2/tf"], "/camera/depth", []),
    ],
)
def test_transforms_are_those_of_the_robots_namespace(
    topics: list[str], robot_topic: str, expected: list[str]
) -> None:
    kinds = dict.fromkeys(topics, "tf2_msgs/msg/TFMessage") | {robot_topic: "sensor_msgs/msg/Image"}
    assert tf_topics(kinds, [robot_topic]) == expected


TURNS = ("laser", "camera", 1.0), ("kinect", "camera", 7.0)


@pytest.mark.parametrize("newest", [0, 1])
@pytest.mark.parametrize("driven", ["base_link", "robot"])
def test_of_several_parents_that_which_leads_to_the_robot_counts(driven: str, newest: int) -> None:
    links = [(driven, "laser", 0.25), ("world", "kinect", 5.0), ("world", "kinect", 6.0), ("camera", "lens", 0.5)]
    found = tree(*TURNS, *links, *TURNS[newest:], *TURNS[:newest])
    found.base = driven
    T, _, note = found.mount("lens")
    assert T is not None
    assert T[0, 3] == pytest.approx(1.75)
    assert "camera" in note and "kinect" in note and "using laser" in note
    assert "moves" not in note  # a frame does not move because its parents differ


def test_a_frame_that_was_handed_over_hangs_where_it_hung_last() -> None:
    found = tree(("base_link", "hand", 1.0), ("hand", "cup", 0.5), ("base_link", "tray", 3.0), ("tray", "cup", 0.5))
    T = found.between("base_link", "cup")
    assert T is not None
    assert T[0, 3] == pytest.approx(3.5)


def test_slow_motion_at_a_high_rate_is_noticed() -> None:
    found = tree(*(("base_link", "lens", 1 + 1e-4 * k) for k in range(100)))
    assert found.has_moving_frames and "lens moves" in found.mount("lens").note


@pytest.mark.parametrize(("x", "w"), [(np.nan, 1.0), (2.0, 0.0)])
def test_a_transform_that_is_none_changes_nothing(x: float, w: float) -> None:
    found = tree(("base_link", "lens", 2.0))
    take(found, "base_link", "lens", x, w)
    T, _, note = found.mount("lens")
    assert T is not None and T[0, 3] == 2 and not note
    assert not found.has_moving_frames


def test_no_more_poses_are_kept_than_asked() -> None:
    found = FrameTree(kept=2)
    for k in range(5):
        take(found, "odom", "base_link", float(k))
    assert [T[0, 3] for _, T in found.odometry("lens")] == [3, 4]
