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
