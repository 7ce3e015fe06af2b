"""The robot's own software: from RGB-D frames to maps, a plan and velocity commands.

It knows neither MuJoCo nor the simulator: any robot that implements :class:`pipeline.robot.Robot` can use it.
"""

import os

# OpenBLAS reads this once, when NumPy is first imported. A second thread is of no use to products as small as the
# pipeline's, and waits for the next one in a busy loop: a fifth of an episode's processor time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
