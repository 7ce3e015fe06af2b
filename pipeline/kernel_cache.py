"""numba's cache of compiled kernels, which is emptied when a kernel has changed.

numba compiles a kernel again if its own file has changed, but not if another kernel has that it calls. This looks
only at kernels cached beside their source, as they are unless ``NUMBA_CACHE_DIR`` is set.
"""

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

PIPELINE = Path(__file__).parent
"""Folder of this package, whose kernels other packages call."""


def drop_outdated(packages: Iterable[Path]) -> None:
    """Delete the compiled kernels in packages, given by their folders, if a ``*_kernels.py`` is newer than any.

    Those that another user compiled, and this one cannot delete, stay.
    """
    files = [file for package in packages for file in package.rglob("*") if file.suffix in (".py", ".nbi", ".nbc")]
    sources = [file for file in files if file.match("*_kernels.py") and file.is_file()]
    compiled = [file for file in files if file.suffix != ".py" and os.access(file.parent, os.W_OK)]
    try:
        changed = max((file.stat().st_mtime for file in sources), default=0.0)
        oldest = min((file.stat().st_mtime for file in compiled), default=changed)
    except FileNotFoundError:  # Another process is deleting them
        return
    for file in compiled if changed > oldest else []:
        with suppress(OSError):
            file.unlink()
