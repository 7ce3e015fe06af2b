"""numba's cache of compiled kernels, which is emptied when a kernel has changed.

numba compiles a kernel again if the kernel's own file has changed, but not if only the file of a called kernel has
changed. Only kernels that are cached next to their source are considered; these are all kernels unless
``NUMBA_CACHE_DIR`` is set.
"""

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

PIPELINE = Path(__file__).parent
"""The folder of this package, whose kernels are called by other packages."""


def drop_outdated(packages: Iterable[Path]) -> None:
    """Delete the compiled kernels in the folders of packages if any ``*_kernels.py`` is newer than one of them.
    Compiled kernels in folders in which this user cannot delete files remain.
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
