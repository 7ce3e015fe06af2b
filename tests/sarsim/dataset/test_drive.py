"""Drives through the NIST arena."""

import mujoco
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.transforms import from_yaw, inverse, roll_pitch_of
from sarsim.arenas.load import load_arena
from sarsim.dataset import drive
from sarsim.dataset.drive import PERIOD, SPEED, DeadReckoning, EndlessDrive, WheelContact
from sarsim.dataset.settings import KEYFRAME_SPACING
from sarsim.ground_truth.columns import convex_bodies
from sarsim.ground_truth.true_surface import GroundTruthSurface, Survey
from sarsim.robots.pose import TrajectorySample
from tests.sarsim.sensors.no_noise import NoNoise

COUNT = 100


class Nist:
    """The arena without a robot."""

    def __init__(self) -> None:
        arena = load_arena("nist_6x4")
        model = mujoco.MjModel.from_xml_string(arena.mjcf_model.to_xml_string())
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        self.start = arena.T_world_start
        self.surface: GroundTruthSurface = Survey(model, data).surface_from(self.start[:3, 3])
        self.wheel_contact = WheelContact(convex_bodies(model, data, None), self.surface.grid)

    def poses(self, seed: int, count: int = COUNT) -> list[TrajectorySample]:
        """A drive from the start."""
        rng = np.random.default_rng(seed)
        return EndlessDrive(self.surface, self.wheel_contact, self.start, rng).poses(count)


@pytest.fixture(scope="module")
def nist() -> Nist:
    return Nist()


@pytest.fixture(scope="module")
def keyframes(nist: Nist) -> list[TrajectorySample]:
    return nist.poses(seed=3)


def poses(keyframes: list[TrajectorySample]) -> np.ndarray:
    return np.array([keyframe.T_world_base for keyframe in keyframes])


def test_it_begins_at_the_start_and_has_as_many_keyframes_as_asked(
    nist: Nist, keyframes: list[TrajectorySample]
) -> None:
    assert len(keyframes) == COUNT
    np.testing.assert_allclose(keyframes[0].T_world_base[:2, 3], nist.start[:2, 3], atol=1e-9)
    times = [keyframe.time for keyframe in keyframes]
    assert times[0] == 0 and (np.diff(times) > 0).all()


def test_every_place_is_drivable(nist: Nist, keyframes: list[TrajectorySample]) -> None:
    near = nist.surface.grid.at(nist.surface.drivable, poses(keyframes)[:, :2, 3])
    # A pose between the centres of two drivable cells may be in the corner of a third cell, which is not drivable.
    assert near.mean() > 0.95


def test_it_climbs_ramps_and_decks_and_leans_on_them_alone(keyframes: list[TrajectorySample]) -> None:
    T = poses(keyframes)
    height, pitch = T[:, 2, 3], np.degrees([roll_pitch_of(pose)[1] for pose in T])
    assert height.max() > 0.16  # on a deck
    assert pitch.min() < -14 and pitch.max() > 14  # up and down
    assert np.abs(pitch).max() < 18
    # Climbing front wheels lift the centre by 0.135 m times the slope; a keyframe vibrates by 1 mm and 0.2°.
    assert np.abs(pitch[np.abs(height) < 0.003]).max() < np.degrees(np.arctan(0.005 / 0.135)) + 0.4
    rolls = np.degrees([roll_pitch_of(pose)[0] for pose in T])
    assert np.abs(rolls).max() < 10  # nearly head-on; at the foot, the wheels of one side may climb first


def test_keyframes_are_apart_as_wanted(nist: Nist, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drive, "TILT_VIBRATION", 0)
    monkeypatch.setattr(drive, "HEIGHT_VIBRATION", 0)
    T = poses(nist.poses(seed=1))
    moved = np.linalg.norm(np.diff(T[:, :2, 3], axis=0), axis=1)
    between = inverse(T[0])[None] @ T  # headings relative to the first
    yaw = np.unwrap(np.arctan2(between[:, 1, 0], between[:, 0, 0]))
    far, turned = moved >= KEYFRAME_SPACING[0] - 1e-9, np.abs(np.diff(yaw)) >= KEYFRAME_SPACING[1] - 1e-6
    assert (far | turned).all()
    assert moved.max() < KEYFRAME_SPACING[0] + 2 * SPEED * PERIOD


def test_it_visits_most_of_the_arena(nist: Nist, keyframes: list[TrajectorySample]) -> None:
    cells = nist.surface.grid.centre_of(np.argwhere(nist.surface.drivable))
    nearest = np.linalg.norm(cells[:, None] - poses(keyframes)[:, :2, 3], axis=2).min(axis=1)
    assert (nearest < 1.0).mean() > 0.8


def test_odometry_drifts_a_little_and_more_and_more(keyframes: list[TrajectorySample]) -> None:
    error = [np.linalg.norm(s.T_odom_base[:2, 3] - s.T_world_base[:2, 3]) for s in keyframes]
    assert error[0] < 1e-9
    driven = np.linalg.norm(np.diff(poses(keyframes)[:, :2, 3], axis=0), axis=1).sum()
    assert 0.001 * driven < max(error) < 0.1 * driven


def test_perfect_dead_reckoning_finds_back(nist: Nist) -> None:
    reckoning = DeadReckoning(NoNoise(), 0.1)
    for k in [0, *range(41), 40]:  # a quarter of a circle of 2 m, from rest to rest
        angle = np.pi / 2 * k / 40
        T = from_yaw(2 * np.sin(angle), 2 - 2 * np.cos(angle), 0.0, angle)
        believed = reckoning.update(T)
    np.testing.assert_allclose(believed, T, atol=0.05)
    np.testing.assert_allclose(believed[:3, :3], T[:3, :3], atol=1e-7)  # the encoders count whole ticks


def test_a_longer_drive_begins_like_a_shorter_one(nist: Nist) -> None:
    first, longer, other = (poses(nist.poses(seed, count)) for seed, count in ((5, 20), (5, 30), (6, 20)))
    np.testing.assert_array_equal(first, longer[:20])
    assert (first != other).any()


def test_a_robot_that_cannot_stand_is_an_input_error(nist: Nist) -> None:
    nowhere = from_yaw(-2.9, -1.9, 3.0, 0.0)
    lost = EndlessDrive(nist.surface, nist.wheel_contact, nowhere, np.random.default_rng(0))
    with pytest.raises(InputError, match=r"\(-2\.90, -1\.90\) m"):
        lost.poses(3)
