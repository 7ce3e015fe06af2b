"""A stranger's MJCF, tried in a process of its own, which may take only so much memory and time."""

import multiprocessing
import os
import resource
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path

import mujoco
import numpy as np
from dm_control import mjcf

from pipeline.errors import InputError

MEMORY = 4_000_000_000
"""bytes beyond what this process has."""
SECONDS = 20
"""of processor time; a process that takes none waits for something, ten times as long."""
TIMESTEP = 1e-4, 0.02
"""s, from and to; the drive's period is the longest."""
MOST_ITERATIONS = 1000
"""of a solver; MuJoCo's own default is 100."""
MOST_USER = 100
"""``user`` numbers of an element."""
ZNEAR, ZFAR = (1e-6, 1.0), (1e-3, 1e6)
"""of ``<visual><map>``, in extents of the model."""


def try_mjcf(path: Path) -> None:
    """Compile an MJCF file and take a step of it.

    Raises:
        InputError: it is no good, holds a number that makes no sense, or takes absurdly much memory or time.
    """
    fork = multiprocessing.get_context("fork")  # another way to start takes a second
    ours, theirs = fork.Pipe(duplex=False)
    process = fork.Process(target=_try, args=(path, theirs))
    process.start()
    theirs.close()
    said = f"more than {MEMORY / 1e9:g} GB or {SECONDS} s are needed to read it"
    with suppress(EOFError):
        said = ours.recv() if ours.poll(10 * SECONDS) else said
    process.kill()
    process.join()
    if said:
        raise InputError(f"{path}: {said}")


def _try(path: Path, pipe: Connection) -> None:
    """Tell through the pipe what is wrong with a file, an empty line if nothing is."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    with suppress(OSError, ValueError):  # elsewhere than on Linux time is limited alone
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
        check_model(model)
        mujoco.mj_step(model, mujoco.MjData(model))
        mjcf.from_path(str(path))
        pipe.send("")
    except InputError as error:
        pipe.send(str(error))
    except Exception as error:
        if "unknown exception" in str(error):
            return  # so MuJoCo says that there is no memory
        pipe.send(f"not a readable MJCF file: {' '.join(str(error).split()) or type(error).__name__}")


def check_model(model: mujoco.MjModel) -> None:
    """Raises InputError if a number of a compiled model makes no sense."""
    options, eye = model.opt, model.vis.map
    _within("timestep", options.timestep, TIMESTEP)
    _within("znear", eye.znear, ZNEAR)
    _within("zfar", eye.zfar, ZFAR)
    for name in ("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations", "sdf_iterations"):
        _within(name, getattr(options, name), (0, MOST_ITERATIONS))
    for name in sorted(dir(model), key=lambda name: name.startswith("bvh")):  # of those the others tell
        value = getattr(model, name)
        if name.startswith("nuser_"):
            _within(name, value, (0, MOST_USER))
        elif isinstance(value, np.ndarray) and value.dtype.kind == "f" and not np.isfinite(value).all():
            raise InputError(f"{name} holds a number that is not finite")


def _within(name: str, value: float, bounds: tuple[float, float]) -> None:
    if not bounds[0] <= value <= bounds[1]:
        raise InputError(f"{name} {value:g} is not between {bounds[0]:g} and {bounds[1]:g}")
