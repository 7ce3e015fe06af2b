import numpy as np
import pytest
from dm_control.rl.control import PhysicsError
from mujoco import mjtCone, mjtIntegrator

from pipeline.errors import InputError
from pipeline.robot import Velocity
from sarsim.arenas.load import load_arena
from sarsim.environment import CONTROL_TIMESTEP, RescueEnvironment, substeps


@pytest.fixture(scope="module")
def environment():
    environment = RescueEnvironment(load_arena("nist_6x4"))
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
    for name, value in step.observation.items():
        np.testing.assert_array_equal(value, getattr(environment.robot, name)(environment.physics))


def test_an_action_is_a_velocity(environment):
    environment.reset()
    robot, physics = environment.robot, environment.physics
    before = robot.T_world_base(physics)[0, 3]
    for _ in range(round(2 / CONTROL_TIMESTEP)):
        environment.step(np.array([0.2, 0.0]))
    assert robot.T_world_base(physics)[0, 3] - before == pytest.approx(0.4 - 0.2**2 / (2 * 0.3), abs=0.02)


def test_every_episode_begins_at_the_start(environment):
    for _ in range(2):
        environment.reset()
        position = environment.robot.T_world_base(environment.physics)[:3, 3]
        np.testing.assert_allclose(position, (-2.4, -1.35, 0), atol=1e-6)
        environment.step(np.array([0.5, 0.5]))


def test_it_steps_as_dm_control_does_and_averages_over_the_time_steps():
    def alone(environment):
        environment.drive(Velocity(0.5, 0.5))
        return environment.inertial_measurements()

    def by_dm_control(environment):
        robot, physics = environment.robot, environment.physics
        speed, gyro = robot.wheel_speed(physics), robot.gyro(physics)
        wheels = environment.firmware.command(Velocity(0.5, 0.5), speed, gyro[2], CONTROL_TIMESTEP)
        physics.bind(robot.actuators).ctrl = wheels
        measured = []
        for _ in range(substeps(physics.timestep())):
            physics.step()
            measured.append((robot.gyro(physics), robot.accelerometer(physics)))
        return sum(measured[1:], np.array(measured[0])) / len(measured)

    def outcome(drive):
        environment = RescueEnvironment(load_arena("nist_6x4"))
        environment.drive(Velocity(0.5, 0.5))
        environment.inertial_measurements()
        mean, state = drive(environment), environment.physics.get_state()
        environment.close()
        return [*mean.ravel(), *state]

    np.testing.assert_array_equal(outcome(alone), outcome(by_dm_control))


def test_a_divergent_simulation_is_an_error(environment):
    environment.reset()
    environment.physics.data.qvel[0] = 1e12
    with pytest.raises(PhysicsError) as caught:
        environment.drive(Velocity())
    assert isinstance(caught.value, InputError)


ARENA = """<mujoco><compiler {}/><option {}/><size {}/><statistic extent="3"/><worldbody><site name="start"/>
<geom type="plane" size="2 2 1"/></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("compiler", "option", "size"),
    [
        ("", 'integrator="Euler" cone="pyramidal" impratio="10" timestep="0.005"', ""),
        ('autolimits="false" fusestatic="true"', "", 'memory="1K"'),
    ],
)
def test_an_arena_of_other_options_loads_and_the_robots_win(compiler, option, size, tmp_path, caplog):
    path = tmp_path / "arena.xml"
    path.write_text(ARENA.format(compiler, option, size))
    environment = RescueEnvironment(load_arena(str(path)))
    options = environment.physics.model.opt
    environment.drive(Velocity())
    assert (options.timestep, options.impratio) == (0.002, 100)
    assert (options.integrator, options.cone) == (mjtIntegrator.mjINT_IMPLICITFAST, mjtCone.mjCONE_ELLIPTIC)
    warnings = [line for line in caplog.messages if "cone elliptic instead of pyramidal" in line]
    assert len(warnings) == bool(option)
    environment.close()


def test_the_time_step_divides_the_control_period():
    assert substeps(0.002) == 10
    assert substeps(0.005) == 4
    assert substeps(CONTROL_TIMESTEP) == 1
    with pytest.raises(InputError, match=r"timestep of 0\.003 s must divide .* 0\.02 s"):
        substeps(0.003)
