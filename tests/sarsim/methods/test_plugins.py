"""Plug-ins: what a command line and a file may ask for, and that nothing is imported before."""

import re
import subprocess
import sys
from dataclasses import dataclass, field
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Annotated

import pytest
import tyro

from pipeline.errors import InputError
from pipeline.plugin import Plugin
from sarsim.commands.cli import run_guarded
from sarsim.commands.settings import save_settings, settings_from
from sarsim.methods import plugins
from sarsim.methods.plugins import make_plugins
from sarsim.plugins.finds.plugin import Finds
from sarsim.settings import EpisodeConfig
from tests.refusal import refusal
from tests.source_tree import ROOT


@dataclass(frozen=True)
class Depths:
    """How deep to dig."""

    least: float = 0.1


@dataclass(frozen=True)
class Spade:
    """Where to dig."""

    count: Annotated[int, tyro.conf.Positional]
    name: str = "spade"
    depths: tyro.conf.Fixed[Depths] = field(default_factory=Depths)


class Digs(Plugin):
    """Digs, and looks for what is there."""

    Settings = Spade
    needs = ("finds",)


@dataclass(frozen=True)
class Hole:
    """Where what was dug goes."""

    path: Path = Path("hole")


class Fills(Plugin):
    """Writes to a path."""

    Settings = Hole


@pytest.fixture(autouse=True)
def _installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some plug-ins, of which one is not sarsim's own."""
    classes = {"finds": Finds, "dig": Digs, "fill": Fills, "theirs": Digs}
    entries = {
        name: EntryPoint(name, f"{kind.__module__}:{kind.__name__}", "sarsim.sink") for name, kind in classes.items()
    }
    monkeypatch.setattr(
        plugins, "installed", lambda groups=plugins.FLAG_GROUPS: entries if "sarsim.sink" in groups else {}
    )
    monkeypatch.setattr(plugins, "is_shipped", lambda name, group: name != "theirs")


def asked(*words: str) -> EpisodeConfig:
    return settings_from(EpisodeConfig, words)


def test_flags_ask_for_plugins_and_set_them() -> None:
    config = asked("--steps", "3", "--dig", "7", "--dig-name", "fork", "--finds", "--seed", "1")
    assert (config.steps, config.seed) == (3, 1)
    assert config.plugins["dig"] == Spade(7, "fork")
    assert [plugin.name for plugin in make_plugins(config)] == ["finds", "dig"]
    assert [plugin.name for plugin in make_plugins(asked("--dig", "2"))] == ["finds", "dig"]
    assert make_plugins(asked()) == []


def test_a_file_repeats_a_run_with_its_plugins_but_for_those_that_write_elsewhere(tmp_path: Path) -> None:
    file = tmp_path / "config.yaml"
    save_settings(asked("--dig", "7", "--fill", "--fill-path", "there"), file)
    again = asked("--config", str(file))
    assert again.plugins == {"dig": Spade(7)}
    assert asked("--config", str(file), "--dig-name", "fork").plugins == {"dig": Spade(7, "fork")}
    file.write_text("plugins:\n  dig:\n    count: 2\n    depths:\n      least: 0.5\n")
    assert asked("--config", str(file)).plugins == {"dig": Spade(2, depths=Depths(0.5))}
    file.write_text("plugins: {theirs: {count: 3}, dig: {count: 2}}")
    assert asked("--config", str(file), "--theirs", "4").plugins == {"theirs": Spade(4), "dig": Spade(2)}


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("plugins: {theirs: {count: 1}}", "a file must not choose code to run; give --theirs as a flag"),
        ("plugins: {fill: {}}", "a file must not set where results go; give --fill as a flag"),
        ("plugins: {dig: {colour: red}}", "unknown setting colour"),
        ("plugins: {nothing: {}}", "--nothing: no such plug-in is installed"),
    ],
)
def test_what_a_file_may_not_ask_for_is_refused(
    text: str, fault: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "config.yaml").write_text(text)
    assert fault in refusal(capsys, run_guarded, lambda: asked("--config", str(tmp_path / "config.yaml")))


def test_a_plugin_that_the_installation_does_not_know_yet_is_a_line() -> None:
    with pytest.raises(InputError, match="--bag: no such plug-in is installed; run: make setup"):
        plugins.find("bag")  # in pyproject.toml, but not among those above
    with pytest.raises(InputError, match=r"--mission league: must be explore.*; run: make setup"):
        plugins.find_mission("league")


def test_a_missing_package_is_a_line_that_names_the_extra() -> None:
    code = (
        "import sys\nsys.modules['rosbags'] = None\nfrom sarsim.methods import plugins\n"
        "(bag,) = plugins.entry_points(group='sarsim.sink', name='bag')\n"
        "try:\n    plugins.load(bag)\nexcept plugins.InputError as error:\n    print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert re.search(r"bag needs the package rosbags.*pip install 'sarsim\[bags\]'", done.stdout), done.stderr


def test_help_lists_plugins_without_importing_them() -> None:
    code = (
        "import sys\nfrom sarsim.methods.plugins import plugins_help\nprint(plugins_help())\n"
        "assert not [name for name in sys.modules if '.plugins.' in name], sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert "--finds" in done.stdout and "league" in done.stdout
