"""Processes that work for another one."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

PARENT = """
import sys, tempfile, time
from sarsim.jobs.processes import connected

def work(pipe, folder):
    with tempfile.TemporaryDirectory(dir=folder):
        print("working", flush=True)
        time.sleep(60)

if __name__ == "__main__":
    process, _ = connected(work, sys.argv[1])
    print(process.pid, flush=True)
    process.join()
"""


def alive(pid: int) -> bool:
    """Whether a process runs; one that only waits to be collected does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize("ended_by", [signal.SIGKILL, signal.SIGINT])
def test_a_worker_ends_tidily_with_its_parent(tmp_path, ended_by):
    script, folder = tmp_path / "parent.py", tmp_path / "folder"
    script.write_text(PARENT)
    folder.mkdir()
    with subprocess.Popen(
        [sys.executable, script, folder], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as parent:
        said = {parent.stdout.readline().strip(), parent.stdout.readline().strip()}
        (worker,) = (int(word) for word in said - {"working"})
        assert alive(worker)
        assert len(list(folder.iterdir())) == 1
        os.kill(parent.pid, ended_by)
        deadline = time.monotonic() + 20
        while alive(worker) and time.monotonic() < deadline:
            time.sleep(0.05)
        assert not alive(worker)
        assert not list(folder.iterdir())


ENDING = """
import atexit, sys, time
from sarsim.jobs.processes import connected

def work(pipe):
    atexit.register(time.sleep, 20)

if __name__ == "__main__":
    process, _ = connected(work)
    process.join(2)
    process.terminate()
"""


def test_a_worker_that_is_ended_at_its_end_says_nothing(tmp_path):
    script = tmp_path / "parent.py"
    script.write_text(ENDING)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=15)
    assert (done.returncode, done.stderr) == (0, "")
