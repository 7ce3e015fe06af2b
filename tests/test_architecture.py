"""The house: who may import whom, how long functions are, and how well documented."""

import ast
import re
from collections.abc import Iterable, Iterator

import networkx as nx
import pytest

from tests.source_tree import ALIASES, Module, PublicFunction, is_text, modules, public_functions

PACKAGES = ("pipeline", "sarsim", "scripts")
FORBIDDEN = {
    "pipeline": ("mujoco", "dm_control", "dm_env", "sarsim", "scripts", "tests"),
    "sarsim": ("scripts", "tests"),
    "scripts": ("tests",),
}
LONGEST_FUNCTION = 40
LEAST_DOCUMENTED = 0.98


# Who imports whom


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


# How long


def test_functions_are_short() -> None:
    long = [
        f"{module.name}.{node.name}: {module.length(node)}"
        for module in modules(*PACKAGES)
        for node in module.nodes
        if isinstance(node, ast.FunctionDef)
        and node.end_lineno - node.lineno >= LONGEST_FUNCTION  # at once, unlike the next
        and module.length(node) > LONGEST_FUNCTION
    ]
    assert not long


# What is documented

EXTENT = r"(?:\.\.\.|…|[\w']+)(?: [-+·/] \w+| [a-z])*(?: or \d)?"
SHAPE = re.compile(rf"\({EXTENT},(?: {EXTENT},?)*\)|\w ?× ?\w|\bscalars?\b")
"""``(N, 3)``, ``(..., 2 or 3)``, ``(N,)``, ``4×4``, ``width × height``; or that numbers are meant."""
UNIT = re.compile(
    r"(?<!\w)(m|m²|m³|mm|cm|px|rad|s|Hz|kg|[Pp]ixels?|cells?|voxels?|degrees?|metres|[Ss]econds|4×4|``(map|world|odom|"
    r"base|base_link|camera|camera_optical|image)``)(?!\w)|°|\bunit (vector|normal|quaternion)|\bof length 1\b"
)
"""A unit; or the frame that points are given in or a 4×4 pose, whose unit is m."""
MEASURE = re.compile(
    r"(?<!\w)(points?|positions?|places?|distances?|heights?|widths?|depth|radius|radii|reach|ways?|poses?|"
    r"centres?|corners?|headings?|yaws?|angles?|bearings?|elevation|offset)(?!\w)",
    re.IGNORECASE,
)
"""Words for lengths and angles."""
POSE = re.compile(r"\bT_[a-z]\w*")
"""The notation for 4×4 poses, whose translations are in m."""


def passes_pose(function: PublicFunction) -> bool:
    """Whether a pose is a parameter or named in the docstring."""
    return bool(POSE.search(function.doc + ast.unparse(function.node.args)))


def is_named(function: PublicFunction) -> bool:
    """Whether every array that passes has a name of :mod:`pipeline.arrays`, where its shape and unit stand."""
    return "NDArray" not in function.types and bool(ALIASES & set(re.findall(r"\w+", function.types)))


def names_its_shapes(function: PublicFunction) -> bool:
    """Whether the docstring gives a shape, or an alias or a pose passes, whose name does."""
    return bool(SHAPE.search(function.doc) or passes_pose(function)) or is_named(function)


def names_its_units(function: PublicFunction) -> bool:
    """Whether the docstring gives a unit if it speaks of a length or an angle; an alias or a pose's name does."""
    is_measured = "float" in function.types and MEASURE.search(function.doc)
    return not is_measured or bool(UNIT.search(function.doc) or passes_pose(function)) or is_named(function)


def test_public_functions_name_the_shapes_and_units_of_their_arrays() -> None:
    """Ruff's D1 sees to it that there is a docstring at all; here is what it says of the arrays that pass."""
    functions = [f for module in modules("pipeline", "sarsim") for f in public_functions(module)]
    passing = [f for f in functions if f.passes_arrays]
    vague = [f.name for f in passing if not (names_its_shapes(f) and names_its_units(f))]
    print(f"{len(passing)} of {len(functions)} public functions pass arrays; no shape or unit: {vague}")
    assert len(passing) > 100
    assert 1 - len(vague) / len(passing) >= LEAST_DOCUMENTED


@pytest.mark.parametrize(
    ("head", "doc", "is_clear"),
    [
        ("def f(a: NDArray[np.float64]) -> float", "Middle of (N, 3) points, m.", True),
        ("def f(a: NDArray[np.float64]) -> float", "Middle of (N, 3) points in ``map``.", True),
        ("def f(a: NDArray[np.float64]) -> float", "Middle of (N, 3) points.", False),
        ("def f(T_map_base: NDArray[np.float64]) -> float", "Yaw of the robot.", True),
        ("def f(R: NDArray[np.float64]) -> float", "Yaw of a 3×3 rotation.", False),
        ("def f(a: NDArray[np.float32]) -> None", "Show heights (..., 2 or 3), m.", True),
        ("def f(a: Points) -> Place", "Their middle.", True),
        ("def f(a: Points, b: NDArray[np.float64]) -> Place", "Their middle.", False),
    ],
)
def test_what_a_docstring_says_of_arrays_is_seen(head: str, doc: str, is_clear: bool) -> None:
    (function,) = public_functions(Module("m", f'{head}:\n    """{doc}"""'))
    assert function.passes_arrays
    assert (names_its_shapes(function) and names_its_units(function)) is is_clear


# What tests reach for


def private_access(module: Module) -> Iterator[str]:
    """Names with a leading underscore that a test takes from what it tests, by attribute, import or string."""
    own = own_privates(module)
    for node in module.nodes:
        if isinstance(node, ast.Attribute) and is_private(node.attr):
            is_own = isinstance(node.value, ast.Name) and node.value.id in ("self", "cls") and node.attr in own
            yield from [] if is_own else [ast.unparse(node)]
        elif isinstance(node, ast.ImportFrom):
            yield from (alias.name for alias in node.names if is_private(alias.name))
        elif isinstance(node, ast.Call) and called(node) in ("setattr", "getattr", "delattr"):
            names = [argument.value for argument in node.args if is_text(argument)]
            yield from (name for name in names if any(map(is_private, name.split("."))))


def called(node: ast.Call) -> str:
    """The last part of the name of what is called."""
    return getattr(node.func, "attr", getattr(node.func, "id", ""))


def own_privates(module: Module) -> set[str]:
    """Private names that the module's own classes assign or define."""
    assigned = {n.attr for n in module.nodes if isinstance(n, ast.Attribute) and isinstance(n.ctx, ast.Store)}
    return assigned | {n.name for n in module.nodes if isinstance(n, ast.FunctionDef)}


def is_private(name: str) -> bool:
    """Whether a name has one leading underscore, and is not what named tuples offer."""
    return re.match("_[^_]", name) is not None and name not in ("_replace", "_asdict", "_fields", "_make")


def test_no_test_reaches_for_privates() -> None:
    found = {module.name: list(private_access(module)) for module in modules("tests")}
    assert {name: names for name, names in found.items() if names} == {}


def test_no_test_module_imports_another() -> None:
    for module in modules("tests"):
        taken = [name for name in module.imports if re.search(r"^tests\.(.+\.)?test_", name)]
        assert not taken, f"{module.name} imports {taken}"


def test_every_way_to_reach_for_privates_is_seen() -> None:
    text = (
        "from pipeline.m import _a, b\nclass T(b):\n    def _d(self):\n        self._c = self._d() + self._e\n"
        "def test(monkeypatch):\n    b._f = 1\n    monkeypatch.setattr(b, '_g', 2)\n    b.__doc__\n"
    )
    assert sorted(private_access(Module("m", text))) == ["_a", "_g", "b._f", "self._e"]
