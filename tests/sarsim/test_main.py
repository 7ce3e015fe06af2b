"""The command ``sarsim``, which calls the others."""

import subprocess
import sys
import tomllib
from pathlib import Path

from sarsim.commands.cli import BAD_INPUT

ROOT = Path(__file__).parents[2]
SCRIPTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
COMMANDS = {name.removeprefix("sarsim-") for name in SCRIPTS if name.startswith("sarsim-")}


def sarsim(*words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "sarsim", *map(str, words)], cwd=ROOT, capture_output=True, text=True
    )


def test_help_says_what_each_command_does() -> None:
    lines = [line.split(maxsplit=1) for line in sarsim().stdout.splitlines()]
    assert {words[0] for words in lines if len(words) > 1} >= COMMANDS


def test_a_subcommand_is_the_command_of_that_name(tmp_path: Path) -> None:
    run = sarsim("export-arena", "--arena", "nist_6x4", "--out", tmp_path / "arena.xml")
    assert run.returncode == 0, run.stderr
    assert "<mujoco" in (tmp_path / "arena.xml").read_text()


def test_a_subcommand_names_itself_without_where_it_is_installed() -> None:
    assert sarsim("export-arena", "--help").stdout.startswith("usage: sarsim export-arena ")


def test_an_unknown_command_is_one_line_with_the_nearest_name() -> None:
    run = sarsim("epsiode")
    assert run.returncode == BAD_INPUT
    assert run.stderr.count("\n") == 1
    assert "episode" in run.stderr.rpartition(";")[2]
