"""The robot's own software: from RGB-D frames to maps, a plan and velocity commands.

It depends on neither MuJoCo nor the simulator, so any robot that implements :class:`pipeline.robot.Robot` can use it.
"""

from pipeline.kernel_cache import PIPELINE, drop_outdated

drop_outdated([PIPELINE])
