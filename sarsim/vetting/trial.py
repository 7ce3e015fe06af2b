"""Reads the MJCF of arenas and robots; untrusted files are first compiled on trial, in a separate process."""

from pathlib import Path

import mujoco
import numpy as np
from dm_control import mjcf
from scipy.spatial import cKDTree

from pipeline.errors import InputError
from pipeline.files import NO_ERROR, run_isolated
from sarsim.assets import asset
from sarsim.vetting.model_files import check_files
from sarsim.vetting.resolved import FLOAT64_DIGITS, resolved

TRIAL_MEMORY = 1_000_000_000  # bytes in addition to this process's memory; the largest shipped arena needs 0.1 GB
TRIAL_SECONDS = 20  # s, maximum processor time
MAX_USER = 100  # Maximum number of ``user`` values of an element
MAX_HEIGHTS = 2_400_000  # Maximum number of height field cells: 6,000 m², the maximum surveyed area, in 5 cm cells
MAX_COORDINATE = 8_000.0  # m from the origin; beyond it, float32 does not resolve 1 mm
ITERATION_RANGE = 0, 1000  # Minimum and maximum iterations of a solver; MuJoCo's default is 100
FACET_RANGE = 3, 128  # Minimum and maximum number of quads along or around a shape; MuJoCo's defaults are at most 28
BOUNDS = {
    "timestep": (1e-4, 0.02),  # s; at most the drive's period
    "iterations": ITERATION_RANGE,
    "ls_iterations": ITERATION_RANGE,
    "noslip_iterations": ITERATION_RANGE,
    "ccd_iterations": ITERATION_RANGE,
    "sdf_iterations": ITERATION_RANGE,
    "extent": (1e-3, MAX_COORDINATE),  # m
    "znear": (1e-6, 1.0),  # Like zfar, in units of the model's extent
    "zfar": (1e-3, 1e6),
    "shadowsize": (0, 16384),  # pixels, the largest texture of common GPUs
    "offsamples": (0, 16),
    "numslices": FACET_RANGE,
    "numstacks": FACET_RANGE,
    "numquads": (1, FACET_RANGE[1]),
}
"""Valid ranges of a model's options and visual settings."""
COMPARED_ARRAYS = (
    ("body_pos", "body_quat", "body_mass", "body_inertia"),
    ("geom_type", "geom_size", "geom_pos", "geom_user"),
)
"""Arrays of bodies and of geoms that must not change when a model is written and read again."""
COMPARISON_TOLERANCE = 1e-6  # m, kg and kg m², maximum difference between the values in ``COMPARED_ARRAYS``
COORDINATE_ARRAYS = [
    "body_pos",
    "geom_pos",
    "geom_size",
    "site_pos",
    "cam_pos",
    "light_pos",
    "mesh_vert",
    "hfield_size",
]
"""Arrays with coordinates in m."""


def read_mjcf(path: Path) -> tuple[mujoco.MjModel, mjcf.RootElement]:
    """A compiled model, and its MJCF in a form that can be merged with another file.

    Shipped files contain no settings that would affect another file; all other files are vetted and resolved.

    Raises:
        InputError: the file is invalid; see :func:`vet_mjcf`.
    """
    if is_shipped(path):
        return mujoco.MjModel.from_xml_path(str(path)), mjcf.from_path(str(path))
    vet_mjcf(path)
    try:
        return resolved(path)
    except InputError as error:  # The file has changed since it was vetted
        raise InputError(f"{path}: {error}") from error


def is_shipped(path: Path) -> bool:
    """Whether a file is one of sarsim's own."""
    return path.resolve().is_relative_to(asset().resolve())


def vet_mjcf(path: Path) -> None:
    """Check the files of untrusted MJCF, then compile it and simulate one step in a separate process.

    Raises:
        InputError: a file is invalid, too large or outside the folder; or the model cannot be compiled, has a value
            out of range, or needs too much memory or time.
    """
    check_files(path)
    said = run_isolated(_trial_result, path, seconds=TRIAL_SECONDS, memory=TRIAL_MEMORY)
    if said != NO_ERROR:
        limits = f"{TRIAL_MEMORY / 1e9:g} GB of memory or {TRIAL_SECONDS} s of processor time"
        raise InputError(
            f"{path}: {said or f'loading it takes more than {limits}, or crashes MuJoCo; simplify the model'}"
        )


def _trial_result(path: Path) -> str:
    """``NO_ERROR`` if a file can be used, otherwise the error message; empty if MuJoCo ran out of memory."""
    try:
        model, root = resolved(path, check_model)
        mujoco.mj_step(model, mujoco.MjData(model))
        again = mujoco.MjModel.from_xml_string(root.to_xml_string(precision=FLOAT64_DIGITS), root.get_assets())
        if not are_alike(model, again):
            return "cannot be read as MJCF: PyMJCF and MuJoCo read different bodies or geoms from it"
        return NO_ERROR
    except InputError as error:
        return str(error)
    except MemoryError:
        return ""
    except Exception as error:
        if "unknown exception" in str(error):
            return ""  # MuJoCo's message when it runs out of memory
        return f"cannot be read as MJCF: {' '.join(str(error).split()) or type(error).__name__}"


def are_alike(one: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Whether two models have the same bodies and geoms, in any order, with the same :data:`COMPARED_ARRAYS`."""
    for names in COMPARED_ARRAYS:
        rows, others = (np.column_stack([getattr(model, name) for name in names]) for model in (one, other))
        if rows.shape != others.shape:
            return False
        if (
            len(rows)
            and max(cKDTree(a).query(b)[0].max() for a, b in ((rows, others), (others, rows))) > COMPARISON_TOLERANCE
        ):
            return False
    return True


def check_model(model: mujoco.MjModel) -> None:
    """Raise InputError if a value of a compiled model is out of range."""
    for owner in (model.opt, model.stat, model.vis.map, model.vis.quality):
        for name in BOUNDS.keys() & set(dir(owner)):
            _check_range(name, getattr(owner, name), BOUNDS[name])
    if model.hfield_data.size > MAX_HEIGHTS:
        raise InputError(f"the height fields have {model.hfield_data.size} cells; the limit is {MAX_HEIGHTS}")
    for name in sorted(dir(model), key=lambda name: name.startswith("bvh")):  # Derived arrays last
        value = getattr(model, name)
        if name.startswith("nuser_"):
            _check_range(name, value, (0, MAX_USER))
        elif isinstance(value, np.ndarray) and value.dtype.kind == "f" and not np.isfinite(value).all():
            raise InputError(f"all values in {name} must be finite")
    for name in COORDINATE_ARRAYS:
        farthest = np.abs(getattr(model, name)).max(initial=0)
        if farthest > MAX_COORDINATE:
            raise InputError(
                f"{name} contains a value of magnitude {farthest:g} m; the limit is {MAX_COORDINATE:g} m"
            )


def _check_range(name: str, value: float, bounds: tuple[float, float]) -> None:
    if not bounds[0] <= value <= bounds[1]:
        raise InputError(f"{name} must be from {bounds[0]:g} to {bounds[1]:g}, not {value:g}")
