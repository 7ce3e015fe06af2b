import numpy as np
import pytest

from sarsim.arenas.load import load_arena
from sarsim.task import CONTROL_TIMESTEP, rescue_environment


@pytest.fixture(scope="module")
def environment():
    environment = rescue_environment(load_arena("nist_6x4"), seed=0)
    yield environment
    environment.close()


def test_it_keeps_the_dm_env_interface(environment):
    step = environment.reset()
    assert step.first()
    environment.action_spec().validate(np.zeros(2))
    for name, spec in environment.observation_spec().items():
        spec.validate(step.observation[name])
    step = environment.step(np.array([0.1, 0.0]))
    assert step.mid()
    assert step.reward == 0


def test_an_action_is_a_velocity(environment):
    environment.reset()
    robot, physics = environment.task.robot, environment.physics
    before = robot.T_world_base(physics)[0, 3]
    for _ in range(round(2 / CONTROL_TIMESTEP)):
        environment.step(np.array([0.2, 0.0]))
    assert robot.T_world_base(physics)[0, 3] - before == pytest.approx(0.4 - 0.2**2 / (2 * 0.3), abs=0.02)


def test_every_episode_begins_at_the_start(environment):
    for _ in range(2):
        environment.reset()
        position = environment.task.robot.T_world_base(environment.physics)[:3, 3]
        np.testing.assert_allclose(position, (-2.4, -1.35, 0), atol=1e-6)
        environment.step(np.array([0.5, 0.5]))
