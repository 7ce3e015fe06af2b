"""Untrusted MJCF is compiled on trial in a process of its own, with limited memory and time."""

from pathlib import Path

import mujoco
import numpy as np
from dm_control import mjcf

from pipeline.errors import InputError
from pipeline.files import GOOD, answer_apart

TRIAL_MEMORY = 4_000_000_000  # bytes beyond those that this process uses
SECONDS = 20  # of processor time
TIMESTEP = 1e-4, 0.02  # s, shortest and longest; the longest is the drive's period
MOST_ITERATIONS = 1000  # of a solver; MuJoCo's own default is 100
MOST_USER = 100  # ``user`` numbers of an element
ZNEAR, ZFAR = (1e-6, 1.0), (1e-3, 1e6)  # of ``<visual><map>``, in extents of the model


def try_mjcf(path: Path) -> None:
    """Compile an MJCF file and simulate one step.

    Raises:
        InputError: it is invalid, has a number that makes no sense, or needs too much memory or time.
    """
    said = answer_apart(lambda: _tried(path), SECONDS, TRIAL_MEMORY)
    if said != GOOD:
        raise InputError(
            f"{path}: {said or f'more than {TRIAL_MEMORY / 1e9:g} GB or {SECONDS} s are needed to read it'}"
        )


def _tried(path: Path) -> str:
    """``GOOD``, or what is wrong with a file; empty if MuJoCo ran out of memory."""
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
        check_model(model)
        mujoco.mj_step(model, mujoco.MjData(model))
        root = mjcf.from_path(str(path))
        mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())  # as PyMJCF writes it
        return GOOD
    except InputError as error:
        return str(error)
    except Exception as error:
        if "unknown exception" in str(error):
            return ""  # MuJoCo's message when it runs out of memory
        return f"not a readable MJCF file: {' '.join(str(error).split()) or type(error).__name__}"


def check_model(model: mujoco.MjModel) -> None:
    """Raises InputError if a number of a compiled model makes no sense."""
    options, eye = model.opt, model.vis.map
    _within("timestep", options.timestep, TIMESTEP)
    _within("znear", eye.znear, ZNEAR)
    _within("zfar", eye.zfar, ZFAR)
    for name in ("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations", "sdf_iterations"):
        _within(name, getattr(options, name), (0, MOST_ITERATIONS))
    for name in sorted(dir(model), key=lambda name: name.startswith("bvh")):  # computed from others: last
        value = getattr(model, name)
        if name.startswith("nuser_"):
            _within(name, value, (0, MOST_USER))
        elif isinstance(value, np.ndarray) and value.dtype.kind == "f" and not np.isfinite(value).all():
            raise InputError(f"{name} holds a number that is not finite")


def _within(name: str, value: float, bounds: tuple[float, float]) -> None:
    if not bounds[0] <= value <= bounds[1]:
        raise InputError(f"{name} {value:g} is not between {bounds[0]:g} and {bounds[1]:g}")
