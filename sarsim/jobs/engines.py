"""The engines by name."""

import os

from sarsim.jobs.engine import Engine
from sarsim.jobs.local_engine import LocalEngine
from sarsim.jobs.ray_engine import RayEngine


def make_engine(name: str = "local", workers: int | None = None) -> Engine:
    """The engine that ``--engine`` names; by default with one worker per core.

    Raises:
        InputError: the engine is not installed.
    """
    workers = workers or len(os.sched_getaffinity(0))
    return RayEngine(workers, os.environ.get("RAY_ADDRESS")) if name == "ray" else LocalEngine(workers)
