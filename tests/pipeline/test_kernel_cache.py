import os
import subprocess
import sys

import pytest

from pipeline.kernel_cache import drop_outdated

CALLER = """\
from numba import njit

from called_kernels import value


@njit(cache=True)
def caller():
    return value()
"""
CALLED = """\
from numba import njit


@njit(cache=True)
def value():
    return {}
"""


@pytest.mark.parametrize("is_dropped", [True, False])
def test_a_kernel_is_compiled_again_if_one_that_it_calls_has_changed(is_dropped, tmp_path):
    (tmp_path / "caller_kernels.py").write_text(CALLER)

    def run() -> str:
        command = [sys.executable, "-c", "import caller_kernels; print(caller_kernels.caller())"]
        return subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True).stdout.strip()

    found = []
    for value in (1, 2):
        (tmp_path / "called_kernels.py").write_text(CALLED.format(value))
        os.utime(tmp_path / "called_kernels.py", (value * 1e10,) * 2)  # later than everything compiled so far
        if is_dropped:
            drop_outdated([tmp_path])
        found.append(run())
    assert found == ["1", "2" if is_dropped else "1"]


def test_what_is_newer_than_its_source_stays(tmp_path):
    compiled = tmp_path / "__pycache__" / "some_kernels.f-1.py311.nbi"
    compiled.parent.mkdir()
    for file in (tmp_path / "some_kernels.py", compiled):
        file.touch()
    os.utime(tmp_path / "some_kernels.py", (1.0, 1.0))
    drop_outdated([tmp_path])
    assert compiled.exists()
    os.utime(compiled, (0.5, 0.5))
    drop_outdated([tmp_path])
    assert not compiled.exists()
