"""Robots in files of others: with a free joint, a stage, a place and names of their own."""

import numpy as np
import pytest

from pipeline.robot import Velocity
from sarsim.arenas.load import load_arena
from sarsim.environment import CONTROL_TIMESTEP, RescueEnvironment
from sarsim.robots.names import robot_file

STAGE = '<light pos="0 0 3"/><geom type="plane" size="9 9 1"/><body name="table" pos="3 0 0"><geom size=".3"/></body>'
BASE = '<body name="base_link" childclass="jackal">'
PLACED = BASE.replace(">", ' pos="1 2 0.3" euler="0 0 40">')


def robot(folder, old, new):
    text = robot_file("jackal").read_text()
    assert old in text
    (folder / "robot.xml").write_text(text.replace(old, new, 1))
    return str(folder / "robot.xml")


def driven(name):
    """Where the robot stands at first and after two seconds ahead, m in the frame of the start, and its mass."""
    environment = RescueEnvironment(load_arena("nist_6x4"), name)
    first = environment.robot.T_world_base(environment.physics)
    for _ in range(round(2 / CONTROL_TIMESTEP)):
        environment.drive(Velocity(0.2, 0.0))
    last = environment.robot.T_world_base(environment.physics)
    base = environment.physics.bind(environment.robot.base).element_id
    mass = environment.physics.model.body_subtreemass[base]
    environment.close()
    return np.array([*first[:3, 3], *last[:3, 3], mass])


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (BASE, f"{BASE}<freejoint/>"),
        (BASE, f'{PLACED}<freejoint name="root" align="true"/>'),
        (BASE, f'{PLACED}<joint name="root" type="free"/>'),
        (BASE, PLACED),
        (BASE, f"{STAGE}{BASE}<freejoint/>"),
        ("<sensor>", '<keyframe><key name="home" qpos="0 0 0 0"/></keyframe><sensor>'),
        ('<geom name="hull"', '<geom name="base/hull"'),
        ('class="jackal">\n      <geom user="0"/>', 'class="jackal">\n      <geom user="0" solref="0.02 1"/>'),
    ],
    ids=["free", "free elsewhere", "free joint", "elsewhere", "on a stage", "keyframe", "slash", "default"],
)
def test_it_drives_as_the_one_that_has_none_of_them(old, new, tmp_path):
    np.testing.assert_allclose(driven(robot(tmp_path, old, new)), driven("jackal"), atol=1e-4)


def test_what_its_free_joint_does_goes_along(tmp_path):
    environment = RescueEnvironment(
        load_arena("nist_6x4"), robot(tmp_path, BASE, f'{BASE}<joint type="free" damping="7" armature="0.2"/>')
    )
    assert set(environment.physics.model.dof_damping[:6]) == {7.0}
    assert set(environment.physics.model.dof_armature[:6]) == {0.2}
    environment.close()
