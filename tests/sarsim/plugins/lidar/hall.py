"""A robot of several parts in a hall whose every distance is known."""

from dataclasses import replace

import mujoco
import numpy as np

from sarsim.plugins.lidar.config import LidarConfig, LidarModel
from sarsim.plugins.lidar.scanner import Scanner

HALL = """<mujoco><size nuser_geom="1"/><worldbody>
<geom name="floor" type="plane" size="20 20 0.1" user="2"/>
<geom name="ahead" type="box" size="0.1 5 2" pos="4.1 0 2" user="1"/>
<geom name="left" type="box" size="5 0.1 2" pos="0 3.1 2" user="7"/>
<geom name="ball" type="sphere" size="0.5" pos="-3.5 0 1" user="6"/>
<geom name="cover" type="box" size="9 9 0.1" pos="0 0 1" group="3"/>
<body name="base_link"><freejoint/><site name="SITE" pos="0 0 1"/>
<geom name="hull" type="sphere" size="0.3" pos="0 0 0.9" group="2" mass="1"/>
<body pos="0 0 1"><joint name="mast" type="hinge" axis="0 1 0"/><camera name="camera" pos="0 0 -0.06"/>
<geom name="arm" type="box" size="0.05 0.05 0.6" pos="0.6 0 0" mass="1"/></body>
<body pos="0 0.4 0.11"><geom name="wheel" type="cylinder" size="0.2 0.05" mass="1"/></body>
</body></worldbody></mujoco>"""
"""A wall 4 m ahead, another 3 m to the left, and a ball whose surface is 3 m behind; a geom that is not drawn."""
CROSS = LidarModel((0.0,), 4, 360, (0.1, 30), 10, (0.0, 0.0), 1e6)
"""One row, whose beams go back, right, ahead and left, without noise."""


class Hall:
    """The hall, and the robot in it."""

    def __init__(self, site: str = "lidar") -> None:
        self.world = mujoco.MjModel.from_xml_string(HALL.replace("SITE", site))
        self.data = mujoco.MjData(self.world)
        self.base = self.world.body("base_link").id
        self.move()

    def move(self, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> None:
        """Place the robot, m and rad."""
        self.data.qpos[:7] = x, y, 0, np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)
        mujoco.mj_forward(self.world, self.data)

    def scanner(self, model: LidarModel | str = CROSS, seed: int | None = None, rolls: bool = False) -> Scanner:
        """A lidar on the robot; with a seed, it has errors."""
        sensor = LidarConfig(model).model() if isinstance(model, str) else model
        rng = None if seed is None else np.random.default_rng(seed)
        return Scanner(self.world, self.data, self.base, sensor, rng, rolls)

    def name(self, geom: int) -> str:
        """Name of a geom."""
        return self.world.geom(geom).name


def dense(**changes: object) -> LidarModel:
    """A row of a hundred thousand beams within half a degree, straight ahead."""
    return replace(CROSS, columns=100_001, field_of_view=0.5, **changes)
