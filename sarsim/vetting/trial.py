"""Untrusted MJCF is compiled on trial in a process of its own, with limited memory and time."""

from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial import cKDTree

from pipeline.errors import InputError
from pipeline.files import GOOD, answer_apart
from sarsim.assets import asset
from sarsim.vetting.model_files import check_files
from sarsim.vetting.resolved import EXACT, resolved

TRIAL_MEMORY = 1_000_000_000  # bytes beyond those that this process uses; the largest shipped arena needs 0.1 GB
SECONDS = 20  # of processor time
MOST_USER = 100  # ``user`` numbers of an element
MOST_HEIGHTS = 2_400_000  # cells of height fields; 6,000 m² of ground, the most that are surveyed, in cells of 5 cm
FARTHEST = 8_000.0  # m from the origin: from here on float32 no longer resolves 1 mm
ITERATIONS = 0, 1000  # of a solver; MuJoCo's own default is 100
FACETS = 3, 128  # along a side or around a drawn shape, which are quads of them; MuJoCo's own default is 28 at most
BOUNDS = {
    "timestep": (1e-4, 0.02),  # s; the longest is the drive's period
    "iterations": ITERATIONS,
    "ls_iterations": ITERATIONS,
    "noslip_iterations": ITERATIONS,
    "ccd_iterations": ITERATIONS,
    "sdf_iterations": ITERATIONS,
    "extent": (1e-3, FARTHEST),  # m
    "znear": (1e-6, 1.0),  # with zfar in extents of the model
    "zfar": (1e-3, 1e6),
    "shadowsize": (0, 16384),  # pixels, the largest texture of common graphics
    "offsamples": (0, 16),
    "numslices": FACETS,
    "numstacks": FACETS,
    "numquads": (1, FACETS[1]),
}
"""What numbers of a model's options and of how it is drawn make sense."""
SAME = (("body_pos", "body_quat", "body_mass", "body_inertia"), ("geom_type", "geom_size", "geom_pos", "geom_user"))
"""Arrays in which a model that is read and written again may not differ."""
ALIKE = 1e-6  # m, kg and kg m²
PLACES = ["body_pos", "geom_pos", "geom_size", "site_pos", "cam_pos", "light_pos", "mesh_vert", "hfield_size"]
"""Arrays in m."""


def is_shipped(path: Path) -> bool:
    """Whether a file is one of sarsim's own."""
    return path.resolve().is_relative_to(asset().resolve())


def vet_mjcf(path: Path) -> None:
    """Check the MJCF of a stranger: its files, then by compiling it and simulating one step in another process.

    Raises:
        InputError: a file is invalid or too large, or lies outside the folder; or the model cannot be compiled, has a
            number out of range, or needs too much memory or time.
    """
    check_files(path)
    said = answer_apart(lambda: _tried(path), SECONDS, TRIAL_MEMORY)
    if said != GOOD:
        raise InputError(f"{path}: {said or f'reading it takes more than {TRIAL_MEMORY / 1e9:g} GB or {SECONDS} s'}")


def _tried(path: Path) -> str:
    """``GOOD``, or what is wrong with a file; empty if MuJoCo ran out of memory."""
    try:
        model, root = resolved(path, check_model)
        mujoco.mj_step(model, mujoco.MjData(model))
        again = mujoco.MjModel.from_xml_string(root.to_xml_string(precision=EXACT), root.get_assets())
        if not are_alike(model, again):
            return "not a readable MJCF file: PyMJCF and MuJoCo read it differently"
        return GOOD
    except InputError as error:
        return str(error)
    except MemoryError:
        return ""
    except Exception as error:
        if "unknown exception" in str(error):
            return ""  # MuJoCo's message when it runs out of memory
        return f"not a readable MJCF file: {' '.join(str(error).split()) or type(error).__name__}"


def are_alike(one: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Whether two models have the same bodies and geoms, in any order, in the same places and of the same masses."""
    for names in SAME:
        rows, others = (np.column_stack([getattr(model, name) for name in names]) for model in (one, other))
        if rows.shape != others.shape:
            return False
        if len(rows) and max(cKDTree(a).query(b)[0].max() for a, b in ((rows, others), (others, rows))) > ALIKE:
            return False
    return True


def check_model(model: mujoco.MjModel) -> None:
    """Raises InputError if a number of a compiled model is out of range."""
    for owner in (model.opt, model.stat, model.vis.map, model.vis.quality):
        for name in BOUNDS.keys() & set(dir(owner)):
            _check(name, getattr(owner, name), BOUNDS[name])
    _check("number of a height field's cells", model.hfield_data.size, (0, MOST_HEIGHTS))
    for name in sorted(dir(model), key=lambda name: name.startswith("bvh")):  # computed from others: last
        value = getattr(model, name)
        if name.startswith("nuser_"):
            _check(name, value, (0, MOST_USER))
        elif isinstance(value, np.ndarray) and value.dtype.kind == "f" and not np.isfinite(value).all():
            raise InputError(f"{name} holds a number that is not finite")
    for name in PLACES:
        _check(f"{name} of", np.abs(getattr(model, name)).max(initial=0), (0, FARTHEST))


def _check(name: str, value: float, bounds: tuple[float, float]) -> None:
    if not bounds[0] <= value <= bounds[1]:
        raise InputError(f"{name} {value:g} is not between {bounds[0]:g} and {bounds[1]:g}")
