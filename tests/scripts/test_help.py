"""The --help of every command: it imports nothing heavy, fits on three screens, and has few enough flags."""

import json
import re
import subprocess
import sys
from functools import cache

import pytest

from scripts.benchmarks.settings import SUBJECTS
from tests.source_tree import ROOT

SUBCOMMANDS = {"train": ["pointnext"], "benchmark": ["", *SUBJECTS]}
COMMANDS = [
    f"{path.stem} {sub}".strip()
    for path in sorted((ROOT / "scripts").glob("*.py"))
    if "main()" in path.read_text()
    for sub in SUBCOMMANDS.get(path.stem, [""])
]
HEAVY = {"cv2", "h5py", "mujoco", "networkx", "numba", "open3d", "rerun", "scipy", "torch"}
MAX_FLAGS = 227
MAX_LINES = 122
ASK_ALL = """
import contextlib, io, json, runpy, sys
said = {}
for command in sys.argv[1:]:
    name, *sub = command.split()
    sys.argv = [f"scripts/{name}.py", *sub, "--help"]  # as a user types it: --help wraps a longer path
    out = io.TextIOWrapper(io.BytesIO(), "utf-8")
    with contextlib.redirect_stdout(out), contextlib.suppress(SystemExit):
        runpy.run_path(sys.argv[0], run_name="__main__")
    out.flush()
    said[command] = out.buffer.getvalue().decode()
print(json.dumps([said, list(sys.modules)]))
"""


@cache
def asked() -> tuple[dict[str, str], list[str]]:
    """What each command's --help prints on 80 columns, and the modules imported for all of them."""
    environment = {"COLUMNS": "80", "PYTHONPATH": str(ROOT)}
    script = [sys.executable, "-c", ASK_ALL, *COMMANDS]
    done = subprocess.run(script, cwd=ROOT, capture_output=True, text=True, check=True, env=environment)
    said, imported = json.loads(done.stdout)
    return said, imported


@pytest.mark.parametrize("command", COMMANDS)
def test_help_is_short_and_says_what_every_flag_is_for(command: str) -> None:
    text = asked()[0][command]
    assert text.startswith("usage: ") and text.count("\n") <= MAX_LINES
    described = re.sub(r"[│\s]+", " ", text)
    assert "{None" not in described and "default: None" not in described
    assert not re.findall(r"(--[\w-]+(?:\.[\w-]+)*) (?:[A-Z{\[]\S* )*\((?:required|default[^)]*)\) --", described)


def test_all_commands_together_have_no_more_flags_than_agreed() -> None:
    names: dict[str, set[str]] = {}  # a flag that several of a command's subcommands have is one to learn
    for command, text in asked()[0].items():  # one that can be negated counts once
        names.setdefault(command.split()[0], set()).update(re.findall(r"^│ (--[\w.-]+)", text, re.MULTILINE))
    assert sum(map(len, names.values())) <= MAX_FLAGS, names
    assert len(names["run_episode"]) >= 20


def test_no_help_imports_what_is_heavy() -> None:
    assert not HEAVY & set(asked()[1])
