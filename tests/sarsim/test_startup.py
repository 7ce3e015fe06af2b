"""What commands set up in their process, in new processes."""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

PREPARE = "from sarsim.startup import prepare_process; prepare_process()"
COUNT = "import numpy as np, os; np.ones((500, 500)) @ np.ones((500, 500)); print(len(os.listdir('/proc/self/task')))"
HOLES = """
import numpy as np

def resident():
    return int(open("/proc/self/statm").read().split()[1]) * 4096

np.ones(2**21)  # what is freed teaches glibc what to keep
before, kept = resident(), []
for _ in range(20):
    large, small = np.ones(2**20), np.ones(2**8)
    kept.append((large, small))
kept = [small for _, small in kept]
del large
print((resident() - before) / 2**23)
"""

SPUN = """
import time, torch
x, spent = torch.ones(10**6), 0.0
torch.set_num_threads(2)
for _ in range(50):
    torch.sin(x)
    begin = time.process_time()
    time.sleep(0.005)
    spent += time.process_time() - begin
print(spent / 0.25)
"""


def printed_after_preparing(program: str) -> str:
    environment = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith("OMP_") and "_NUM_THREADS" not in name
    }
    return subprocess.check_output(
        [sys.executable, "-c", f"{PREPARE}\n{program}"], env=environment, text=True
    ).strip()


def test_numpy_computes_in_one_thread() -> None:
    alone = printed_after_preparing("import os; print(len(os.listdir('/proc/self/task')))")
    assert printed_after_preparing(COUNT) == alone


def test_threads_sleep_while_there_is_nothing_to_compute() -> None:
    assert float(printed_after_preparing(SPUN)) < 0.05  # of the time; those that spin take 0.1 to 0.2


def test_memory_of_large_arrays_that_are_gone_is_given_back() -> None:
    assert float(printed_after_preparing(HOLES)) < 2  # of the 20 arrays


@pytest.mark.skipif(os.getuid() != 0, reason="needs another user")
def test_a_user_without_a_home_caches_kernels_in_a_folder_of_their_own() -> None:
    with TemporaryDirectory() as shared:
        program = f"""
import os, tempfile, sarsim.startup
tempfile.tempdir, os.environ["HOME"] = {shared!r}, "/nonexistent"
os.setuid(65534)
sarsim.startup._choose_cache()
folder = os.environ["NUMBA_CACHE_DIR"]
print(folder, oct(os.stat(folder).st_mode & 0o777))
"""
        Path(shared).chmod(0o777)
        environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
        printed = subprocess.check_output([sys.executable, "-c", program], env=environment, text=True)
        assert printed.split() == [f"{shared}/sarsim-65534", "0o700"]
        Path(shared, "sarsim-65534").chmod(0o777)  # anybody could put kernels there
        printed = subprocess.check_output([sys.executable, "-c", program], env=environment, text=True)
        assert printed.split()[0] != f"{shared}/sarsim-65534"


@pytest.mark.parametrize(
    "error", ["RuntimeError('Could not determine home directory.')", "PermissionError(13, 'denied')"]
)
def test_a_home_folder_that_cannot_be_found_or_read_does_no_harm(error: str) -> None:
    program = f"""
import pathlib
from unittest.mock import Mock
from sarsim.startup import prepare_process
pathlib.Path.home = Mock(side_effect={error})
prepare_process()
"""
    for cache in ({}, {"NUMBA_CACHE_DIR": "/own"}):
        subprocess.run([sys.executable, "-c", program], env=os.environ | cache, check=True)
