"""The house: who may import whom."""

import re
from collections.abc import Iterable

import networkx as nx
import pytest

from tests.source_tree import Module, modules

PACKAGES = ("pipeline", "sarsim", "scripts")
FORBIDDEN = {
    "pipeline": ("mujoco", "dm_control", "dm_env", "sarsim", "scripts", "tests"),
    "sarsim": ("scripts", "tests"),
    "scripts": ("tests",),
}


def is_in(name: str, package: str) -> bool:
    """Whether a dotted name is that package or inside it."""
    return f"{name}.".startswith(f"{package}.")


@pytest.mark.parametrize("package", FORBIDDEN)
def test_no_import_goes_back(package: str) -> None:
    assert modules(package)
    for module in modules(package):
        back = [name for name in module.imports for other in FORBIDDEN[package] if is_in(name, other)]
        assert not back, f"{module.name} imports {back}"


def test_every_way_to_import_is_seen() -> None:
    text = "import mujoco.viewer\nfrom sarsim import commands\ndef f():\n    from dm_control.mjcf import Physics\n"
    assert Module("m", text).imports == ["mujoco.viewer", "sarsim.commands", "dm_control.mjcf.Physics"]


def folder_circles(found: Iterable[Module]) -> list[set[str]]:
    """Sets of neighbours, folders or modules of one folder, that import one another in a circle."""
    found = list(found)
    names, graph = {module.name for module in found}, nx.DiGraph()
    for module in found:
        for imported in module.imports:
            pair = neighbours(module.name, known(imported, names))
            graph.add_edges_from([pair] if pair else [])
    return [circle for circle in nx.strongly_connected_components(graph) if len(circle) > 1]


def known(name: str, names: set[str]) -> str:
    """The module that an imported name is or lies in; empty if it is none of ``names``."""
    while name and name not in names:
        name = name.rpartition(".")[0]
    return name


def neighbours(importer: str, imported: str) -> tuple[str, str] | None:
    """The two entries of the innermost common folder that modules lie in; None if one holds the other."""
    a, b = importer.split("."), imported.split(".")
    for depth, (one, other) in enumerate(zip(a, b, strict=False), 1):
        if one != other:
            return ".".join(a[:depth]), ".".join(b[:depth])
    return None


def test_no_folders_import_one_another_in_a_circle() -> None:
    assert folder_circles(modules(*PACKAGES)) == []


def test_a_circle_is_seen_at_any_depth() -> None:
    a = Module("p.a.x", "from p.b import y")
    b = Module("p.b.y", "from q import z")
    assert folder_circles([a, b, Module("q.z", "")]) == []
    assert folder_circles([a, b, Module("q.z", "import p.a.x as x")]) == [{"p", "q"}]
    assert folder_circles([a, Module("p.b.y", "def f():\n    from p.a.w import g"), Module("p.a.w", "")]) == [
        {"p.a", "p.b"}
    ]


def test_no_test_module_imports_another() -> None:
    for module in modules("tests"):
        taken = [name for name in module.imports if re.search(r"^tests\.(.+\.)?test_", name)]
        assert not taken, f"{module.name} imports {taken}"
