"""Poses of SDF, and frames relative to one another."""

from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform, Rotation

from pipeline.errors import InputError
from pipeline.transforms import from_rotation
from sarsim.arenas.sdf.frames import MODEL, Frames
from sarsim.arenas.sdf.values import pose_of

POSES = st.tuples(*[st.floats(-50, 50)] * 3, *[st.floats(-4, 4)] * 3)


def read(pose):
    return pose_of(fromstring(f"<link><pose>{' '.join(map(repr, pose))}</pose></link>"), "here")


def pose(text, **attributes):
    written = " ".join(f"{key}='{value}'" for key, value in attributes.items())
    return pose_of(fromstring(f"<link><pose {written}>{text}</pose></link>"), "here")


def test_roll_pitch_and_yaw_are_about_fixed_axes():
    T = pose("1 2 3 0 0 1.5707963267948966")
    np.testing.assert_allclose(T, [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], atol=1e-15)
    # First rolled, y to z; then pitched about the fixed y, z to x; then yawed about the fixed z, x to y.
    np.testing.assert_allclose(pose("0 0 0 90 90 90", degrees="true")[:3, :3] @ [0, 1, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(pose("0 0 0 90 90 0", degrees="true")[:3, :3] @ [0, 1, 0], [1, 0, 0], atol=1e-15)


def test_a_rotation_may_be_a_quaternion():
    T = pose("0 0 1 0 0 0.7071067811865476 0.7071067811865476", rotation_format="quat_xyzw")
    np.testing.assert_allclose(T, pose("0 0 1 0 0 90", degrees="1"), atol=1e-15)


@pytest.mark.parametrize("text", ["0 0 0 0 0", "0 0 0 0 0 nan", "0 0 inf 0 0 0", "a b c d e f", "0 0 9000 0 0 0"])
def test_a_pose_is_six_finite_numbers(text):
    with pytest.raises(InputError, match=r"^here, <pose>: "):
        pose(text)


def test_no_pose_is_the_identity():
    np.testing.assert_array_equal(pose(""), np.eye(4))
    np.testing.assert_array_equal(pose_of(fromstring("<link/>"), "here"), np.eye(4))


@given(st.lists(POSES, min_size=1, max_size=5))
def test_nested_models_multiply_as_rigid_transforms_do(chain):
    frames, name, expected = Frames("here"), [], RigidTransform.identity()
    outer = frames
    for depth, numbers in enumerate(chain):
        inside = Frames("here")
        outer.add(f"m{depth}", read(numbers), "__model__", inside)
        name.append(f"m{depth}")
        outer = inside
        rotation = Rotation.from_euler("ZYX", numbers[:2:-1])  # about the turned axes in the opposite order
        expected = expected * RigidTransform.from_components(numbers[:3], rotation)
    np.testing.assert_allclose(frames.pose("::".join(name)), expected.as_matrix(), atol=1e-9)


@given(POSES, POSES)
def test_a_placed_frame_ends_where_the_pose_says(placed, inner):
    frames, inside = Frames("here", "world"), Frames("here")
    inside.add("grip", read(inner), "__model__")
    frames.add("m", read(placed), "world", inside, "grip")
    np.testing.assert_allclose(frames.pose("m::grip"), read(placed), atol=1e-9)


def test_a_merged_model_gives_its_frames_to_the_scope():
    frames, inside = Frames("here"), Frames("here")
    inside.add("tip", pose("0 0 1 0 0 0"), "__model__")
    frames.add("m", pose("2 0 0 0 0 0"), "__model__", inside, merged=True)
    frames.add("flag", pose("0 3 0 0 0 0"), "tip")
    np.testing.assert_allclose(frames.pose("flag")[:3, 3], [2, 3, 1])


def test_a_model_merged_into_a_merged_model_gives_its_frames_too():
    frames, middle, inmost = Frames("here"), Frames("here"), Frames("here")
    inmost.add("tip", pose("0 0 1 0 0 0"), "__model__")
    middle.add("n", pose("0 3 0 0 0 0"), "__model__", inmost, merged=True)
    frames.add("m", pose("2 0 0 0 0 0"), "__model__", middle, merged=True)
    np.testing.assert_allclose(frames.pose("tip")[:3, 3], [2, 3, 1])


def test_a_circle_and_an_unknown_frame_are_refused():
    frames = Frames("here")
    for a, b in ("ab", "bc", "ca"):
        frames.add(a, np.eye(4), b)
    frames.add("d", np.eye(4), "nowhere")
    with pytest.raises(InputError, match=r"here: .*a, b, c"):
        frames.pose("a")
    with pytest.raises(InputError, match=r"here: .*'nowhere'"):
        frames.pose("d")
    with pytest.raises(InputError, match="there is no frame"):
        frames.pose("d::e")


def test_a_name_may_hold_the_separator_itself():
    frames = Frames("m")
    frames.add("part::link", from_rotation(np.eye(3), (1, 2, 3)), MODEL)
    frames.add("other", from_rotation(np.eye(3), (0, 0, 1)), "part::link")
    np.testing.assert_allclose(frames.pose("other")[:3, 3], (1, 2, 4))
