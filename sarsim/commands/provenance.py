"""The state of the code and the properties of the machine with which figures are measured."""

import importlib.metadata
import os
import platform
import subprocess
from pathlib import Path
from typing import Any

from pipeline.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
UNRELATED = ":!*.md", ":!*.sh", ":!assets/weights/*.yaml", ":!scripts/results.py"
CODE = ("pipeline", "sarsim", "scripts", "assets", "requirements*.txt", *UNRELATED)
"""Git pathspecs of the files on which figures depend; a change elsewhere leaves the figures valid."""


def state_of_code() -> str:
    """The last commit that changed the code, with a + if there are uncommitted changes.

    Raises:
        InputError: the code is not in a git checkout.
    """
    found = _git("log", "-1", "--format=%h", "--", *CODE)
    changed = _git("status", "--porcelain", "--untracked-files=no", "--", *CODE)
    return found + "+" * bool(changed)


def _git(*words: str) -> str:
    try:
        return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError) as error:
        said = " ".join(str(getattr(error, "stderr", None) or error).split())
        raise InputError(f"{ROOT}: results can be measured only in a git checkout: {said}") from error


def machine() -> dict[str, Any]:
    """Properties of this machine, and versions of the packages, with which figures are measured."""
    return {
        "system": platform.platform(),
        "processor": processor(),
        "instructions": instructions(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "packages": {name: importlib.metadata.version(name) for name in ("mujoco", "numba", "numpy", "torch")},
    }


def processor() -> str:
    """The processor's name, if the system reports it."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def instructions() -> str:
    """The widest vector instructions that numba uses: the processor's, unless NUMBA_CPU_FEATURES limits them."""
    from numba import config  # imported here, because it takes too long for --help
    from numba.core.codegen import get_host_cpu_features

    features = get_host_cpu_features() if config.CPU_FEATURES is None else config.CPU_FEATURES
    names = {"+avx512f": "AVX-512", "+avx2": "AVX2", "+avx": "AVX", "+sse2": "SSE", "+neon": "NEON"}
    return next((name for feature, name in names.items() if feature in features.split(",")), platform.machine())
