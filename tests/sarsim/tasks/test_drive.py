import warnings
from copy import deepcopy

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from pipeline.errors import InputError
from sarsim.arenas.load import load_arena
from sarsim.environment import RescueEnvironment
from sarsim.sensors.camera import RgbdCamera
from sarsim.sensors.rendering import Renderer
from sarsim.tasks.drive import DepthRays, Drive, DriveWeights

NAME = "sarsim.tasks:sarsim/Drive-v0"


@pytest.mark.parametrize("options", [{}, {"depth": (84, 84)}])
def test_gymnasiums_checks_pass(options: dict[str, object]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(NAME, **options).unwrapped)


def test_a_step_is_a_tenth_of_a_second_and_rewards_progress() -> None:
    env = Drive(weights=DriveWeights(progress=1.0, time=0.0, contact=0.0))
    observation, info = env.reset(seed=3)
    far, reward = np.linalg.norm(observation["goal"]), 0.0
    assert info["sim_time_s"] == 0
    for _ in range(10):
        observation, r, is_over, is_cut, info = env.step(np.array([0.5, 0.0], np.float32))
        reward += r
        assert env.observation_space.contains(observation) and not (is_over or is_cut)
    assert info["sim_time_s"] == pytest.approx(1.0)
    assert 0.1 < info["navigation.distance_m"] < 0.5
    assert reward == pytest.approx(far - np.linalg.norm(observation["goal"]), abs=0.02)
    assert observation["odometry"][0] == pytest.approx(info["navigation.distance_m"], rel=0.2)
    env.close()
    with pytest.raises(InputError, match="closed"):
        env.step(np.zeros(2, np.float32))


def test_an_episode_is_cut_off_in_time() -> None:
    env = Drive(seconds=0.3)
    env.reset(seed=0)
    assert [env.step(np.zeros(2, np.float32))[3] for _ in range(3)] == [False, False, True]
    env.close()


def test_physics_that_diverge_end_the_episode_with_what_was_last_observed() -> None:
    env = Drive(depth=(8, 6), weights=DriveWeights(time=-0.5, tipping=-7.0))
    env.reset(seed=0)
    for _ in range(8):
        last, *_, before = env.step(np.array([1.0, 0.0], np.float32))
    assert env.world is not None
    env.world.physics.data.qvel[0] = 1e12
    observation, reward, is_over, is_cut, info = env.step(np.zeros(2, np.float32))
    assert is_over and not is_cut and info["navigation.tipped"]
    assert all(np.array_equal(observation[name], last[name]) for name in last)
    assert reward == pytest.approx(-0.5 * 0.1 - 7)
    for name in ("sim_time_s", "navigation.distance_m", "navigation.reached"):
        assert info[name] == before[name]
    env.close()


def test_ray_cast_depth_is_the_rendered_depth() -> None:
    world = RescueEnvironment(load_arena("nist_6x4"))
    model, data = world.physics.model.ptr, world.physics.data.ptr
    with Renderer(model, 84, 84) as renderer:
        camera = RgbdCamera(renderer, world.robot.camera.full_identifier)
        image = camera.capture(data)
        depth = DepthRays(model, data, camera.camera_id, (84, 84)).depth(image.T_world_camera)
    both = (depth > 0) & (image.depth > 0)
    assert both.mean() > 0.5 and ((depth > 0) == (image.depth > 0)).mean() > 0.99
    off = abs(depth - image.depth)[both]
    assert np.median(off) < 1e-3 and (off < 0.02).mean() > 0.97  # the others are edges
    world.close()


@pytest.mark.parametrize(
    "options",
    [
        {"seconds": 0.0}, {"seconds": float("nan")}, {"depth": (0, 84)}, {"depth": (84.5, 84)}, {"depth": (84,)},
        {"depth": 64}, {"weights": {"progres": 1.0}}, {"weights": {"progress": float("nan")}},
        {"render_mode": "human"},
    ],
)  # fmt: skip
def test_wrong_settings_are_said_in_one_line(options: dict[str, object]) -> None:
    with pytest.raises(InputError):
        Drive(**options)


@pytest.mark.parametrize("action", [np.full(2, np.nan), [np.inf, 0], np.zeros(3), 0.5, "ahead", None])
def test_an_action_that_is_none_is_refused_and_changes_nothing(action: object) -> None:
    env = Drive()
    env.reset(seed=0)
    with pytest.raises(InputError, match=r"action = .*: must be 2 finite numbers"):
        env.step(action)
    assert env.step(np.zeros(2))[-1]["sim_time_s"] == pytest.approx(0.1)
    for refused, said in (
        (lambda: env.reset(options={"maps": 3}), "no option maps"),
        (lambda: deepcopy(env), "copied"),
    ):
        with pytest.raises(InputError, match=said):
            refused()
    env.close()
