"""numba's cache of compiled kernels, which is emptied when a kernel has changed.

numba compiles a kernel again if its own file has changed, but not if another kernel has that it calls.
"""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

PIPELINE = Path(__file__).parent
"""Folder of this package, whose kernels other packages call."""


def drop_outdated(packages: Iterable[Path]) -> None:
    """Delete the compiled kernels in packages, given by their folders, if any ``*_kernels.py`` is newer than one."""
    files = [file for package in packages for file in package.rglob("*") if file.suffix in (".py", ".nbi", ".nbc")]
    changed = max((file.stat().st_mtime for file in files if file.stem.endswith("_kernels")), default=0.0)
    compiled = [file for file in files if file.suffix != ".py"]
    with suppress(OSError):  # Another process may be deleting them, or they may be read-only
        if changed > min((file.stat().st_mtime for file in compiled), default=changed):
            for file in compiled:
                file.unlink()
