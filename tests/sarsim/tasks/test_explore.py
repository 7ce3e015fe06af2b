import gc
import sys
import weakref
from copy import deepcopy
from pathlib import Path
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest
from dm_control import mjcf

from pipeline.errors import InputError
from pipeline.exploration.next_best_view import NextBestView
from pipeline.explorer import Explorer
from pipeline.mapper import Mapper
from pipeline.planning.path_plan import PathPlan
from pipeline.semantic_map.classifier import TruthClassifier
from sarsim.arenas.arena import RescueArena
from sarsim.arenas.load import load_arena
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from sarsim.tasks.explore import Explore
from tests.sarsim.rooms import room

NAME = "sarsim.tasks:sarsim/Explore-v0"
PERSON = '<body name="victim_a" pos="-0.45 0.4 0.2"><geom type="box" size="0.1 0.1 0.2" user="6"/></body>'
ROOM = room((-0.6, 1.4), (-0.8, 0.8), PERSON)
"""2 × 1.6 m; the person is behind the robot, out of its view at the start."""
ALONE = 2
"""Steps that the robot explores without the task."""


@pytest.fixture(scope="module")
def arena(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Path of the room's MJCF."""
    path = tmp_path_factory.mktemp("arena") / "room.xml"
    path.write_text(ROOM)
    return str(path)


@pytest.mark.filterwarnings("error")  # as which gymnasium's own checks of spaces, resets and steps complain
def test_an_agent_that_takes_the_robots_own_choice_explores_as_the_robot_does(arena: str) -> None:
    robot = SimulatedRobot(load_arena(arena), SimulationConfig(), seed=7)
    alone = Explorer(robot, Mapper(robot.model, TruthClassifier(), seed=7))
    for _ in range(ALONE):
        alone.drive(alone.step())
    poses = np.array([pose.T_world_base for pose in robot.trajectory])
    robot.close()
    env = gymnasium.make(NAME, arena=arena, weights={"ground": 1.0, "time": 0.0, "contact": 0.0})
    env.reset(options={"seed": 8})
    _, begun = env.reset(options={"seed": 7})
    info, rewards = begun, 0.0
    for _ in range(ALONE):
        observation, reward, is_over, is_cut, info = env.step(info["own_choice"])
        assert env.observation_space.contains(observation) and not (is_over or is_cut)
        rewards += reward
    assert np.array_equal([pose.T_world_base for pose in env.unwrapped.explorer.pilot.robot.trajectory], poses)
    found = info["victims.visible"] - begun["victims.visible"]
    seen = info["exploration.explored_fraction"] - begun["exploration.explored_fraction"]
    assert 0.1 * seen < rewards - 10 * found < 3.2 * seen  # the room has 3.2 m²
    env.close()


def test_an_episode_ends_where_nothing_is_worth_the_drive(arena: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(NextBestView, "next_viewpoint", lambda *_: None)
    env = Explore(arena)
    first, (again, info) = env.reset(seed=0)[0], env.reset(seed=0)
    assert all(np.array_equal(first[key], again[key]) for key in first)
    assert info["action_mask"].sum() == 1
    *_, is_over, is_cut, info = env.step(0)
    assert (is_over, is_cut) == (True, False) and info["exploration.ended"] == "not_worth_it"
    env.close()


def test_on_the_way_back_the_robots_own_choice_drives_back(arena: str, monkeypatch: pytest.MonkeyPatch) -> None:
    env = Explore(arena)
    _, info = env.reset(seed=0)
    back = PathPlan(np.array([[0.5, 0.0, 0.0]]), np.array([False]), [], 0.5)
    decide = Explorer.decide
    monkeypatch.setattr(Explorer, "decide", lambda *given: (None, decide(*given)[1], back))
    monkeypatch.setattr(NextBestView, "worthwhile_viewpoints", lambda self, context, first, limit: [first])
    observation, *_, info = env.step(info["own_choice"])
    assert env.observation_space.contains(observation)
    observation, *_ = env.step(info["own_choice"])
    assert observation["pose"][:2] == pytest.approx([0.5, 0.0], abs=0.15)
    env.close()


def test_a_pose_is_the_place_to_go_to_and_finds_pay_and_time_costs(arena: str) -> None:
    env = Explore(arena, action="pose", steps=1, weights={"ground": 0.0, "time": -1.0}, render_mode="rgb_array")
    assert env.render() is None
    env.reset(seed=0)
    observation, reward, is_over, is_cut, info = env.step(np.array([0.8 / 6.4, 0.0, 1.0], np.float32))
    assert observation["pose"] == pytest.approx([0.8, 0.0, -1.0, 0.0], abs=0.35)
    assert info["victims.visible"] == info["victims.present"] == 1
    assert reward == pytest.approx(10 - info["sim_time_s"] - info["navigation.collisions"])
    assert (is_over, is_cut) == (False, True)
    image = env.render()
    assert image is not None and image.shape == (480, 1120, 3)
    env.close()
    for use in (env.reset, lambda: env.step(0)):
        with pytest.raises(InputError, match="closed"):
            use()


def test_an_arena_of_ones_own_is_built_with_the_seed_of_each_episode(monkeypatch: pytest.MonkeyPatch) -> None:
    seeds = []

    def own(seed: int) -> RescueArena:
        seeds.append(seed)
        return RescueArena(mjcf.from_xml_string(ROOM), "own")

    monkeypatch.setitem(sys.modules, "own_rooms", SimpleNamespace(own=own))
    env = Explore("own_rooms:own")
    for seed in (7, 7, 8):
        _, info = env.reset(options={"seed": seed})
        assert seeds[-1] == info["seed"] == seed
    assert seeds == [7, 8]
    env.close()


def test_time_does_not_go_back_if_physics_diverge(arena: str) -> None:
    env = Explore(arena)
    _, before = env.reset(seed=0)
    assert env.explorer is not None and isinstance(env.explorer.pilot.robot, SimulatedRobot)
    env.explorer.pilot.robot.physics.data.qvel[0] = 1e12
    *_, is_over, _, info = env.step(before["own_choice"])
    assert is_over and info["navigation.tipped"]
    assert info["sim_time_s"] >= before["sim_time_s"]
    env.close()


def test_wrong_settings_and_steps_before_the_start_are_said_in_one_line() -> None:
    for options in ({"steps": 0}, {"steps": 1.5}, {"action": "x"}, {"odometry": "x"}, {"weights": {"x": 1.0}}):
        with pytest.raises(InputError):
            Explore(**options)
    with pytest.raises(InputError, match="reset"):
        Explore().step(0)
    for wrong in ({"maps": 3}, {"seed": "x"}, {"seed": -1}):
        with pytest.raises(InputError, match="reset: "):
            Explore().reset(options=wrong)


@pytest.mark.parametrize("action", ["viewpoint", "pose"])
def test_an_action_that_is_none_is_refused(action: str, arena: str) -> None:
    env = Explore(arena, action=action)
    env.reset(seed=0)
    for wrong in (np.nan, np.full(3, np.nan), "x", None, -1):
        with pytest.raises(InputError, match="action = "):
            env.step(wrong)
    with pytest.raises(InputError, match="copied"):
        deepcopy(env)
    env.close()


def test_with_the_networks_counts_what_is_found_and_not_what_is_in_view(tmp_path: Path) -> None:
    (path := tmp_path / "room.xml").write_text(ROOM.replace("-0.45 0.4 0.2", "1.2 0.3 0.2"))
    env = Explore(str(path), detects=True, weights={"ground": 0.0, "time": 0.0, "contact": 0.0})
    _, info = env.reset(options={"seed": 7})
    assert info["victims.visible"] == 1  # a box that stands for a person, which no network takes for one
    _, reward, _, _, info = env.step(info["own_choice"])
    assert info["victims.found"] == reward == 0
    env.close()


def test_an_environment_frees_the_maps_of_an_earlier_episode(arena: str) -> None:
    env = Explore(arena)
    env.reset(seed=0)
    maps = weakref.ref(env.explorer.mapper)
    gc.disable()
    try:
        env.reset(seed=1)
    finally:
        gc.enable()
    assert maps() is None
    env.close()
