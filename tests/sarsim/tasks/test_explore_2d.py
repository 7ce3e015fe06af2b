import warnings
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from PIL import Image

from pipeline.errors import InputError
from sarsim.tasks.explore_2d import Explore2D, best_heading
from sarsim.tasks.settings import VIEWPOINTS

NAME = "sarsim.tasks:sarsim/Explore2D-v0"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a dungeon map: a room of 120 × 200 pixels."""
    pixels = np.full((160, 240, 4), 127, np.uint8)
    pixels[20:140, 20:220] = 194
    pixels[24:40, 24:40] = (255, 216, 0, 255)
    Image.fromarray(pixels).save(tmp_path / "room.png")
    return tmp_path


@pytest.mark.parametrize("options", [{}, {"action": "pose"}, {"rules": "papers"}, {"split": "test"}])
def test_gymnasiums_checks_pass(options: dict[str, str]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(NAME, **options).unwrapped)


def test_a_room_is_explored_from_the_nearest_viewpoints(folder: Path) -> None:
    env = Explore2D(folder, render_mode="rgb_array")
    _, info = env.reset(seed=0)
    reward, is_over = 0.0, False
    seen = info["exploration.explored_fraction"] * 120 * 200
    while not is_over:
        observation, r, is_over, is_cut, info = env.step(0)
        assert env.observation_space.contains(observation) and not is_cut
        reward += r
    assert info["exploration.explored_fraction"] >= 1 - 250 / (120 * 200)
    ground = info["exploration.explored_fraction"] * 120 * 200 - seen
    assert reward == pytest.approx(ground - 0.1 * info["sim_time_s"])
    image = env.render()
    assert image is not None and image.shape == (160, 240, 3)


def test_numbers_past_the_last_viewpoint_count_from_the_first(folder: Path) -> None:
    env = Explore2D(folder)
    _, info = env.reset(seed=0)
    count = int(info["action_mask"].sum())
    assert 1 < count < VIEWPOINTS
    first = env.step(1)[0]
    env.reset(seed=0)
    again = env.step(1 + count)[0]
    assert all(np.array_equal(first[key], again[key]) for key in first)


def test_a_pose_is_the_place_to_go_to(folder: Path) -> None:
    env = Explore2D(folder, action="pose")
    env.reset(seed=0)
    observation, *_ = env.step(np.array([60 / 96, 40 / 96, 0.5], np.float32))
    assert np.allclose(observation["pose"][:2], (60, 40))


def test_an_episode_is_cut_off_after_as_many_steps_as_moves(folder: Path) -> None:
    env = Explore2D(folder, action="pose")
    env.reset(seed=0)
    steps = [env.step(np.zeros(3, np.float32))[2:4] for _ in range(128)]
    assert steps[-1] == (False, True) and steps[-2] == (False, False)


def test_the_camera_looks_where_most_is_to_be_seen() -> None:
    assert best_heading(np.array([3.0, -3.1, 0.0]), 1.0) in (3.0, -3.1)


def test_environments_run_in_processes() -> None:
    envs = gymnasium.make_vec(NAME, num_envs=2, vectorization_mode="async")
    observation, _ = envs.reset(seed=0)
    assert observation["label"].shape == (2, 64, 64)
    assert envs.step(np.zeros(2, np.int64))[1].shape == (2,)
    envs.close()


def test_wrong_settings_are_said_in_one_line(tmp_path: Path) -> None:
    for options in ({"rules": "x"}, {"split": "x"}, {"action": "x"}, {"maps": tmp_path / "none"}, {"maps": tmp_path}):
        with pytest.raises(InputError):
            Explore2D(**options)
