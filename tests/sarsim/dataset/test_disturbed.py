"""A generator that is killed at random moments, or whose disk is full, loses nothing.

``KILLS`` in the environment says how often something is killed; ``make endurance`` asks for more than the suite.
"""

import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sarsim.commands import generate_dataset
from sarsim.commands.generate_dataset import GenerateDatasetConfig
from sarsim.commands.settings import run_with_settings
from sarsim.dataset.manifest import sha256_of
from tests.refusal import refusal
from tests.sarsim.dataset.small import InProcess

KILLS = int(os.environ.get("KILLS", "1"))
SCRIPT = Path(__file__).parents[3] / "scripts" / "generate_dataset.py"
FLAGS = "--scenes 2 --frames 2 --workers 1 --seed 2 --width 160 --height 120 --arenas nist_6x4"
COMMAND = generate_dataset.generate_dataset, GenerateDatasetConfig
LONGEST = 12.0
"""s, latest time of a kill; a run takes about as long."""
WORKERS_KILLED = 2
"""Largest number of killed workers in a run: a scene is given up when a third worker dies over it."""


def arguments(folder: Path) -> list[str]:
    """Of the command."""
    return ["--out", str(folder), *FLAGS.split()]


def start(folder: Path) -> subprocess.Popen[str]:
    """Start a generator in a session of its own."""
    return subprocess.Popen(
        [sys.executable, SCRIPT, *arguments(folder)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def checksums(folder: Path) -> dict[str, str]:
    """SHA-256 of every file by its path."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): sha256_of(path) for path in files}


def assert_whole(folder: Path, expected: dict[str, str]) -> None:
    """Assert that every scene that has its final name is complete."""
    for path, digest in checksums(folder).items():
        assert not path.endswith(".h5") or digest == expected[path]


def children(process: subprocess.Popen[str]) -> list[int]:
    """Ids of the other processes of its session."""
    stats = [path.read_text() for path in Path("/proc").glob("[0-9]*/stat") if path.exists()]
    # After the command's name in brackets: state, parent, group, session.
    fields = [(int(stat.split()[0]), stat.rsplit(")", 1)[1].split()) for stat in stats]
    alive = [pid for pid, rest in fields if rest[3] == str(process.pid) and rest[0] != "Z"]
    return [pid for pid in alive if pid != process.pid]


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The files of an undisturbed run, in this process."""
    folder = tmp_path_factory.mktemp("undisturbed") / "data"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(generate_dataset, "make_engine", lambda *flags: InProcess())
        run_with_settings(*COMMAND, arguments(folder))
    return checksums(folder)


def test_a_generator_that_is_killed_again_and_again_loses_nothing(tmp_path: Path, expected: dict[str, str]) -> None:
    folder, rng = tmp_path / "data", np.random.default_rng(2)
    process, workers = start(folder), 0
    for _ in range(KILLS):
        try:
            process.wait(rng.uniform(0, LONGEST))
        except subprocess.TimeoutExpired:
            found = children(process)
            kinds = ["command", "everything", *(["worker"] if found and workers < WORKERS_KILLED else [])]
            if (kind := rng.choice(kinds)) == "worker":
                workers += 1
                os.kill(int(rng.choice(found)), signal.SIGKILL)
                continue
            (os.kill if kind == "command" else os.killpg)(process.pid, signal.SIGKILL)
        process.communicate()
        assert_whole(folder, expected)
        process, workers = start(folder), 0
    if workers:
        process.communicate()
        process = start(folder)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    assert checksums(folder) == expected


def test_a_full_disk_is_one_line_and_leaves_nothing_half_written(
    tmp_path: Path, expected: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, before = tmp_path / "data", resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 16, before[1]))  # also of the worker
    try:
        line = refusal(capsys, run_with_settings, *COMMAND, arguments(folder))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert "File too large" in line
    assert_whole(folder, expected)
    assert not list(folder.rglob("*.part"))
