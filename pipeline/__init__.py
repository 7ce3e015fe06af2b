"""The robot's own software: from RGB-D frames to maps, a plan and velocity commands.

It knows neither MuJoCo nor the simulator: any robot that implements :class:`pipeline.robot.Robot` can use it.
"""

import os

# OpenBLAS reads this once, when NumPy is first imported. A second thread is of no use to products as small as the
# pipeline's, and waits for the next one in a busy loop: a fifth of an episode's processor time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# OpenCV reads this once, when it is first imported, and refuses larger images by their headers; its own bound, a
# gigapixel, takes gigabytes and half a minute. 64 megapixels are four times as many as those of a photo camera.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(2**26))
