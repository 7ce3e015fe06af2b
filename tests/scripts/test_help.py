"""The --help of every command: it is fast, fits on three screens, and has few enough flags."""

import re
import resource
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from scripts.benchmark import SUBJECTS

ROOT = Path(__file__).parents[2]
SCRIPTS = ROOT / "scripts"
SUBCOMMANDS = {"train": ["pointnext", "yolo"], "benchmark": ["", *SUBJECTS]}
COMMANDS = [
    [path.stem, *sub]
    for path in sorted(SCRIPTS.glob("*.py"))
    if "main()" in path.read_text()
    for sub in ([name] for name in SUBCOMMANDS.get(path.stem, [""]))
]
HEAVY = ("cv2", "h5py", "mujoco", "networkx", "numba", "open3d", "rerun", "scipy", "torch")
MOST_FLAGS = 207
MOST_LINES = 120
MOST_SECONDS = 1.5


@cache
def help_of(*command: str) -> tuple[str, float]:
    """What a command's --help prints on 80 columns, and the seconds of processor time that it takes."""
    name, *sub = (word for word in command if word)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, f"scripts/{name}.py", *sub, "--help"],  # as a user types it: --help wraps a longer path
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
        env={"COLUMNS": "80", "PYTHONPATH": str(ROOT)},
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return done.stdout, seconds


def flags(text: str) -> set[str]:
    """The flags of a --help; one that can be negated counts once."""
    return set(re.findall(r"^│ (--[\w.-]+)", text, re.MULTILINE))


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_help_comes_soon_and_is_short(command: list[str]) -> None:
    text, seconds = help_of(*command)
    assert text.count("\n") <= MOST_LINES
    assert seconds <= MOST_SECONDS


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_every_flag_says_what_it_is_for(command: list[str]) -> None:
    text, _ = help_of(*command)
    described = re.sub(r"[│\s]+", " ", text)
    assert not re.findall(r"(--[\w-]+(?:\.[\w-]+)*) (?:[A-Z{\[]\S* )*\((?:required|default[^)]*)\) --", described)


def test_all_commands_together_have_no_more_flags_than_agreed() -> None:
    names: dict[str, set[str]] = {}  # a flag that several of a command's subcommands have is one to learn
    for name, sub in COMMANDS:
        names.setdefault(name, set()).update(flags(help_of(name, sub)[0]))
    assert sum(map(len, names.values())) <= MOST_FLAGS, names
    assert len(names["run_episode"]) >= 20


def test_no_command_imports_what_is_heavy() -> None:
    names = [f"scripts.{name}" for name in sorted({command[0] for command in COMMANDS})]
    program = f"import sys, {', '.join(names)}; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert not set(HEAVY) & set(loaded.split())
