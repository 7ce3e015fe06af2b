"""What the pages tell readers to run: Python in the order of its page, lines of a shell as their commands read them.

Snippets and lines that take over a minute run in ``make endurance`` (``SARSIM_DOCUMENTS=1``).
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from pipeline.explorer import Explorer
from pipeline.sink import Step
from sarsim.commands import cli, settings
from sarsim.commands.run_episode import EpisodeConfig
from sarsim.commands.settings import save_settings
from sarsim.dataset.generate import generate
from tests.sarsim.dataset.small import RECIPE, InProcess
from tests.source_tree import ROOT

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^ *```(\w+)\n(.*?)^ *```", re.DOTALL | re.MULTILINE)
COMMAND = re.compile(r"(?:python (?:scripts/(\w+)\.py|(-m \S+))|\b(sarsim-[a-z-]+))(.*)")
ENTRIES = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
"""The module and function of each installed command, by name."""
WHOLE = bool(os.environ.get("SARSIM_DOCUMENTS"))
"""Whether what takes over a minute runs too."""
OWN = (
    "FOLDER", "bags/office", "my.cfg", "my.onnx", "my.weights", "my.safetensors", "my_images", "my_robot.xml",
    "office", "hall.world", "hall.txt", "office.world", "rgbd_dataset_freiburg1_room", "things.yaml",
    "runs/detect/train/weights/best.onnx", "rgbd_dataset_freiburg2_pioneer_360.bag",
    "rgbd_dataset_freiburg2_pioneer_slam.bag", "rgbd_dataset_freiburg2_pioneer_slam2.bag",
    "rgbd_dataset_freiburg2_pioneer_slam3.bag",
)  # fmt: skip
"""What the pages name of the reader's own, empty here."""
DATA = ("data/ramps", "data/arenas", "data/rooms")
"""Datasets that other pages make."""
MODULES = {"mine": "extend.md", "my_explorer": "tutorial-method.md"}
"""The reader's own modules, and the pages that hold their code."""
RUN = ("run_episode", "export_arena", "export_map", "validate_mission", "score_mission")
"""Commands whose lines are run whole, if they name nothing of the reader's own."""


def blocks(page: Path, language: str) -> list[str]:
    """The blocks of a language on a page, in their order."""
    return [text for kind, text in BLOCK.findall(page.read_text()) if kind == language]


def script(entry: str) -> str:
    """The script in ``scripts/`` that runs the same command as an entry point."""
    return ENTRIES[entry].partition(":")[0].rpartition(".")[2]


def lines(page: Path) -> list[list[str]]:
    """The command and its words of each line of a page's shell blocks; ``$network`` is a name in a loop."""
    text = "\n".join(blocks(page, "sh")).replace("\\\n", " ").replace("$network", "pointnext")
    text = text.replace("make episode", "sarsim-episode")
    text = re.sub(r".*--tyro-print-completion.*", "", text)  # of which nothing is parsed
    found = [COMMAND.search(line) for line in re.split(r"\n|;|&+", text)]
    return [
        [match[1] or match[2] or script(match[3]), *shlex.split(match[4], comments=True)] for match in found if match
    ]


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder like that of a checkout, without what a reader would make in it."""
    for name in ("assets", "docs", "scripts"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


class Parsed(BaseException):
    """What a command was given; raised in place of running it."""

    def __init__(self, given: Mapping[str, Any]):
        self.given = given


def given_to(command: str, words: list[str], monkeypatch: pytest.MonkeyPatch) -> Mapping[str, Any]:
    """The settings that a command reads from the words of its line, which name what is there."""
    check_names = cli.check_names

    def stop(given: Mapping[str, Any]) -> None:
        check_names(given)
        raise Parsed(given)

    monkeypatch.setattr(sys, "argv", [f"{command}.py", *words])
    for module in (cli, settings):
        monkeypatch.setattr(module, "check_names", stop)
    with pytest.raises(Parsed) as parsed:
        import_module(f"scripts.{command}").main()
    return parsed.value.given


def make(command: str, given: Mapping[str, Any]) -> None:
    """Leave what a command would, as far as later lines name it."""
    out = given.get("out")
    if command == "run_episode":
        config = EpisodeConfig(**given)
        out = config.folder
        out.mkdir(parents=True, exist_ok=bool(config.resume))
        for name in ("report.json", "topology.json", "report.html"):
            (out / name).touch()
        save_settings(config, out / "config.yaml")
        if config.mission != "explore":
            (out / "handed_in").mkdir()
        bag = config.plugins.get("bag")
        for extra in (bag.path if bag else None, config.tum):
            if extra:
                extra.mkdir(parents=True)
    elif out and out.suffix:
        for made in {out, out.with_suffix(".cfg"), out.with_suffix(".yaml")}:
            made.touch()
    elif out:
        (out / "scenes").mkdir(parents=True, exist_ok=command == "sweep")
        (out / "scenes" / "00000.h5").touch()


@pytest.mark.parametrize("page", [page for page in PAGES if lines(page)], ids=lambda page: page.name)
def test_every_line_is_one_that_its_command_takes_and_names_what_is_there(
    page: Path, desk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module, source in MODULES.items():
        (desk / f"{module}.py").write_text("\n".join(blocks(ROOT / "docs" / source, "python")))
    for name in OWN:
        (desk / name).parent.mkdir(parents=True, exist_ok=True)
        (desk / name).touch() if Path(name).suffix else (desk / name).mkdir()
    (desk / "things.yaml").write_text(blocks(ROOT / "docs" / "arenas.md", "yaml")[0])
    mentioned = " ".join(" ".join(line) for line in lines(page))
    for name in DATA:
        if f"--out {name} " not in mentioned:
            (desk / name / "scenes").mkdir(parents=True)
            (desk / name / "scenes" / "00000.h5").touch()
    for command, *words in lines(page):
        if command.startswith("-m"):
            files = [word.partition("=")[2] or word for word in words if not word.startswith("--") or "=" in word]
            assert all(Path(file).exists() for file in files), words
            continue
        with monkeypatch.context() as patch:
            given = given_to(command, words, patch)
        make(command, given)


@pytest.fixture
def few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let explorers end after a drive, unless everything is run whole."""
    step = Explorer.step

    def ended(explorer: Explorer) -> Step:
        made = step(explorer)
        return replace(made, viewpoint=None, plan=None) if explorer.steps > 1 else made

    if not WHOLE:
        monkeypatch.setattr(Explorer, "step", ended)


@pytest.mark.parametrize("page", [page for page in PAGES[1:] if blocks(page, "python")], ids=lambda page: page.name)
def test_the_python_of_a_page_runs_from_its_top(
    page: Path, desk: Path, request: pytest.FixtureRequest, few_steps: None, capsys: pytest.CaptureFixture[str]
) -> None:
    code = "\n".join(blocks(page, "python"))
    for source, copy in re.findall(r"^cp (\S+) (\S+)$", "\n".join(blocks(page, "sh")), re.MULTILINE):
        shutil.copy(source, copy)
    if "runs/nist_6x4-0" in code:  # an episode takes long, and most pages need none
        (desk / "runs").mkdir()
        (desk / "runs" / "nist_6x4-0").symlink_to(request.getfixturevalue("episode"))
    for name in ("ramps", "first", "lidar"):
        if f"data/{name}" in code:
            recipe = replace(RECIPE, plugins={"lidar": None}) if name == "lidar" else RECIPE
            generate(recipe, 1, desk / "data" / name, InProcess())
    exec(compile(code, page.name, "exec"), {"__name__": "page"})


def calls(page: Path) -> list[list[str]]:
    """The lines of a page that can be run whole without a screen, a network of one's own or a file of one's own."""
    own = [*OWN, *(f"{module}:" for module in MODULES), ".safetensors", "--view"]
    return [line for line in lines(page) if line[0] in RUN and not any(o in word for o in own for word in line[1:])]


@pytest.fixture(scope="module")
def default_episode(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the episode with which many pages begin."""
    out = tmp_path_factory.mktemp("default") / "run"
    subprocess.run([sys.executable, ROOT / "scripts" / "run_episode.py", "--out", out], check=True)
    return out


@pytest.mark.skipif(not WHOLE, reason="whole episodes: make endurance runs them")
@pytest.mark.parametrize("page", [page for page in PAGES if calls(page)], ids=lambda page: page.name)
def test_the_lines_of_a_page_run_in_their_order(page: Path, desk: Path, default_episode: Path) -> None:
    for command, *words in calls(page):
        if (command, words) == ("run_episode", []):
            (desk / "runs").mkdir(exist_ok=True)
            (desk / "runs" / "nist_6x4-0").symlink_to(default_episode)
        else:
            subprocess.run([sys.executable, f"scripts/{command}.py", *words], check=True, stdout=subprocess.DEVNULL)
