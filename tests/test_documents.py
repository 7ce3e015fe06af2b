"""What the documents name is there: files, headings, pictures, flags, imports, the site's pages."""

import ast
import json
import re
import runpy
import tomllib
from importlib import import_module
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pytest
import yaml
from dm_control import mjcf

from sarsim.arenas.load import load_arena
from sarsim.ground_truth.true_surface import Survey
from scripts.results import README, generated_pages
from tests.source_tree import ROOT

DOCUMENTS = sorted([*ROOT.glob("*.md"), *(p for top in ("assets", "docs") for p in (ROOT / top).rglob("*.md"))])
WEIGHTS = sorted(p for p in (ROOT / "assets" / "weights").iterdir() if p.suffix in (".safetensors", ".weights"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
PAGES = sorted((ROOT / "docs").glob("*.md"))
RESULTS = sorted((ROOT / "docs" / "results").glob("*.md"))
CODE = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)
TARGET = re.compile(r"\]\(<?([^)\s>]+)|^\[[^\]]+\]:\s*(\S+)|(?:src|href)=\"([^\"]+)\"", re.MULTILINE)
ELSEWHERE = re.compile(r"[a-z]+:")
HEADING = re.compile(r"^#+ +(.+)$", re.MULTILINE)
FENCED = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
NAMED = re.compile(r"(?<![\w/.])((?:pipeline|sarsim|scripts|tests|docs|assets)/(?!NAME|\w+-v\d)[\w./-]*\w/?)")
FLAG = re.compile(r"(?:scripts/\w+\.py|sarsim-[a-z])[^`#\n]*?--[^`#\n]*")
PYTHON = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
PIN = re.compile(r"^([\w.-]+)==(\S+)", re.MULTILINE)

document = pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))


def targets(text: str) -> list[str]:
    """What a Markdown text links to or shows in this repository: a path, a path#heading or a #heading."""
    found = ["".join(match) for match in TARGET.findall(CODE.sub("", text))]
    return [unquote(target) for target in found if not ELSEWHERE.match(target)]


def anchors(text: str) -> set[str]:
    """Anchors of the headings, as GitHub and mkdocs name them."""
    plain = [re.sub(r"[^\w\- ]", "", heading.lower()) for heading in HEADING.findall(FENCED.sub("", text))]
    return {heading.strip().replace(" ", "-") for heading in plain}


def leads_somewhere(target: str, document: Path) -> bool:
    """Whether the file is there and has the heading."""
    path, _, anchor = target.partition("#")
    file = document.parent / path if path else document
    return file.exists() and (not anchor or anchor in anchors(file.read_text()))


@document
def test_links_lead_somewhere(document: Path) -> None:
    broken = [t for t in targets(document.read_text()) if not leads_somewhere(t, document)]
    assert not broken


@document
def test_tables_are_whole(document: Path) -> None:
    """A blank line among the rows would end a table."""
    tables = re.findall(r"(?:^ *\|.*\n)+", FENCED.sub("", document.read_text()), re.MULTILINE)
    assert not [table for table in tables if not re.fullmatch(r" *\|[-|]+\|", table.split("\n")[1])]


@document
def test_paths_that_are_named_are_there(document: Path) -> None:
    assert not [path for path in NAMED.findall(document.read_text()) if not (ROOT / path).exists()]


@pytest.fixture(scope="module")
def settings() -> set[str]:
    """Names of parameters, fields, plug-ins and their settings, of which commands make flags, spelt like flags."""
    paths = [path for package in ("pipeline", "sarsim", "scripts") for path in (ROOT / package).rglob("*.py")]
    nodes = [node for path in paths for node in ast.walk(ast.parse(path.read_text()))]
    fields = {n.target.id for n in nodes if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)}
    plugins = {name for group in PROJECT["entry-points"].values() for name in group}
    names = fields | {node.arg for node in nodes if isinstance(node, ast.arg)} | plugins
    names |= {f"{plugin}-{field}" for plugin in plugins for field in fields}
    return {f"--{name.replace('_', '-')}" for name in names} | {"--help", "--tyro-print-completion"}


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_flags_are_settings(page: Path, settings: set[str]) -> None:
    commands = " ".join(FLAG.findall(page.read_text()))
    flags = {re.sub(r"--[\w-]+\.", "--", flag) for flag in re.findall(r"--[a-z][\w.-]*", commands)}
    unknown = {re.sub("^--no-", "--", flag) for flag in flags} - settings
    assert not unknown


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_python_in_pages_imports_what_is_there(page: Path) -> None:
    for block in PYTHON.findall(page.read_text()):
        for node in ast.parse(block).body:
            if isinstance(node, ast.ImportFrom) and node.module:
                module = import_module(node.module)
                assert all(hasattr(module, alias.name) for alias in node.names), ast.unparse(node)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_a_page_begins_with_what_it_is_about(page: Path) -> None:
    title, opening = page.read_text().split("\n\n")[:2]
    assert title.startswith("# ") and "\n" not in title
    assert opening[0] not in "`|#!<-" and len(opening.split()) > 10


def test_every_picture_is_shown_on_a_page() -> None:
    pictures = {f"images/{path.name}" for path in (ROOT / "docs" / "images").iterdir()}
    shown = set().union(*(targets(page.read_text()) for page in (*PAGES, *RESULTS, README)))
    assert pictures <= {target.removeprefix("docs/").removeprefix("../") for target in shown}


def test_badges_are_drawn_from_the_project() -> None:
    namespace = runpy.run_path(str(ROOT / "scripts" / "pictures" / "badges.py"))
    assert {file: file.read_text() for file in namespace["badges"]()} == namespace["badges"]()


def test_pages_of_results_are_what_is_made_of_the_figures() -> None:
    made = generated_pages()
    assert {path for path in made if path.read_text() != made[path]} == set()
    assert set(RESULTS) - made.keys() == {ROOT / "docs" / "results" / "earlier.md"}


@pytest.mark.parametrize("name", ["first.raf", "example.raf"])
def test_arenas_of_the_tutorial_have_a_start(name: str) -> None:
    assert load_arena(str(ROOT / "docs" / name)).T_world_start.shape == (4, 4)


def test_an_mjcf_file_of_a_page_is_an_arena(tmp_path: Path) -> None:
    (room,) = re.findall(
        r"^```xml\n(<mujoco.*?)^```", (ROOT / "docs" / "arenas.md").read_text(), re.DOTALL | re.MULTILINE
    )
    (tmp_path / "room.xml").write_text(room)
    assert load_arena(str(tmp_path / "room.xml")).T_world_start.shape == (4, 4)


def test_the_site_is_made_with_pinned_tools() -> None:
    asked = dict(PIN.findall("\n".join(PROJECT["optional-dependencies"]["docs"])))
    locked, shared = (dict(PIN.findall((ROOT / d / "requirements.txt").read_text())) for d in ("docs", "."))
    assert asked.items() <= locked.items()
    assert locked.keys().isdisjoint(shared)


@pytest.mark.parametrize("weights", WEIGHTS, ids=lambda path: path.name)
def test_shipped_weights_have_a_card_as_hugging_face_reads_them(weights: Path) -> None:
    _, head, text = weights.with_suffix(".md").read_text().split("---\n", 2)
    about = yaml.safe_load(head)
    assert about["license"] == PROJECT["license"].lower() and "search-and-rescue" in about["tags"]
    assert weights.name in text


def test_the_site_has_every_page_once() -> None:
    listed = re.findall(r"[:-] ([\w/-]+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE)
    pages = {str(page.relative_to(ROOT / "docs")) for page in [*PAGES, *RESULTS]} - {"tried.md", "results/earlier.md"}
    made = ["index.md", "contributing.md", "changelog.md", "gallery.md", "flags.md", "notebook.md"]
    assert sorted(listed) == sorted([*pages, *made])


def test_goals_that_a_page_names_can_be_reached() -> None:
    named = re.findall(r"--goals((?: -?\d[\d.]*)+)", (ROOT / "docs" / "driving.md").read_text())
    goals, arena = np.array(" ".join(named).split(), np.float64).reshape(-1, 2), load_arena("nist_6x4")
    physics = mjcf.Physics.from_mjcf_model(arena.mjcf_model)
    surface = Survey(physics.model.ptr, physics.data.ptr).surface_from(arena.T_world_start[:3, 3])
    assert len(goals) == 3
    assert surface.grid.at(surface.drivable, goals).all()


def test_the_first_lines_of_python_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (code,) = PYTHON.findall(README.read_text())
    assert "steps=20)" in code
    exec(compile(code.replace("steps=20)", "steps=1)"), "README.md", "exec"), {})
    assert "present" in ast.literal_eval(capsys.readouterr().out)
    assert (tmp_path / "runs" / "random-7-0" / "report.html").exists()


def test_the_notebook_runs_from_an_episode_to_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.chdir(tmp_path)
    cells = json.loads((ROOT / "docs" / "episode.ipynb").read_text())["cells"]
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    assert all(cell["outputs"] for cell in cells[2:] if cell["cell_type"] == "code")  # after the imports
    assert "STEPS = 20\n" in code
    space: dict[str, Any] = {}
    exec(compile(code.replace("STEPS = 20\n", "STEPS = 1\n"), "episode.ipynb", "exec"), space)
    space["viewer"].close()
    files = {path.name for path in (tmp_path / "runs" / "notebook").iterdir()}
    assert files >= {"episode.rrd", "ground.tif", "metric_map.npz", "semantic_map.ply", "topology.json"}
