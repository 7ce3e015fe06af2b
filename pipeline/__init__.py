"""The robot's own software: from RGB-D frames to maps, a plan and velocity commands.

It knows neither MuJoCo nor the simulator: any robot that implements :class:`pipeline.robot.Robot` can use it.
"""

import ctypes
import os

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8  # of malloc.h
LARGE = 2**22
"""Bytes from which glibc gives memory back as soon as it is free.

By itself it learns to keep what is as large as what was freed, for each thread apart. Between arrays that stay, a
long run then holds half a gigabyte and more of holes. With a bound of 1 MB, a fifth of the processor time would go
into it.
"""
if hasattr(libc := ctypes.CDLL(None), "mallopt"):
    libc.mallopt(M_MMAP_THRESHOLD, LARGE)
    libc.mallopt(M_TRIM_THRESHOLD, 8 * LARGE)
    libc.mallopt(M_ARENA_MAX, 1)

# OpenBLAS reads this once, when NumPy is first imported. A second thread is of no use to products as small as the
# pipeline's, and waits for the next one in a busy loop: a fifth of an episode's processor time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# OpenCV reads this once, when it is first imported, and refuses larger images by their headers; its own bound, a
# gigapixel, takes gigabytes and half a minute. 64 megapixels are four times as many as those of a photo camera.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(2**26))
