"""The robot's own software: from RGB-D frames to maps, a plan and velocity commands.

It depends on neither MuJoCo nor the simulator: any robot that implements :class:`pipeline.robot.Robot` can use it.
"""

import ctypes
import os

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -3, -8  # of malloc.h
LARGE = 2**22
"""Allocations of at least this many bytes are returned to the system as soon as they are freed.

By default glibc raises this threshold to the size of what was freed, per thread. Fragmentation then
wastes half a gigabyte or more in a long run. A threshold of 1 MB would cost a fifth of the processor time.
"""
if hasattr(libc := ctypes.CDLL(None), "mallopt"):
    libc.mallopt(M_MMAP_THRESHOLD, LARGE)
    libc.mallopt(M_TRIM_THRESHOLD, 8 * LARGE)
    libc.mallopt(M_ARENA_MAX, 1)

# OpenBLAS reads this once, when NumPy is first imported. A second thread does not speed up products as small as the
# pipeline's, but its busy-waiting costs a fifth of an episode's processor time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# OpenCV reads this once, when it is first imported, and rejects images whose header declares more pixels. Its
# default, a gigapixel, takes gigabytes of memory and half a minute. 64 megapixels are enough for any photo.
os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(2**26))
