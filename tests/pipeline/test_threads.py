import os
import subprocess
import sys

import pytest

COUNT = "import numpy as np, os; np.ones((500, 500)) @ np.ones((500, 500)); print(len(os.listdir('/proc/self/task')))"


@pytest.mark.parametrize("package", ["pipeline", "sarsim"])
def test_numpy_starts_no_threads_of_its_own(package: str) -> None:
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    command = [sys.executable, "-c", f"import {package}; {COUNT}"]
    assert subprocess.check_output(command, env=environment, text=True).strip() == "1"


HOLES = """
import numpy as np, {package}

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


@pytest.mark.parametrize("package", ["pipeline", "sarsim"])
def test_memory_of_large_arrays_that_are_gone_is_given_back(package: str) -> None:
    output = subprocess.check_output([sys.executable, "-c", HOLES.format(package=package)], text=True)
    assert float(output) < 2  # of the 20 arrays
