"""The rule of dependence: scripts → sarsim → pipeline, never back."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FORBIDDEN = {
    "pipeline": ("mujoco", "dm_control", "dm_env", "sarsim", "scripts", "tests"),
    "sarsim": ("sarsim.scripts", "scripts", "tests"),
    "scripts": ("tests",),
}


def imported(source: str) -> Iterator[str]:
    """Dotted names that a module imports, at the top or inside a function."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def modules(package: str) -> list[Path]:
    """The modules of a package; the link from sarsim to scripts is not followed."""
    found = sorted((ROOT / package).rglob("*.py"))
    return [p for p in found if not p.is_relative_to(ROOT / "sarsim" / "scripts")]


def is_in(name: str, package: str) -> bool:
    """Whether a dotted name is that package or inside it."""
    return f"{name}.".startswith(f"{package}.")


@pytest.mark.parametrize("package", FORBIDDEN)
def test_no_import_goes_back(package: str) -> None:
    assert modules(package)
    for module in modules(package):
        names = list(imported(module.read_text()))
        back = [name for name in names for other in FORBIDDEN[package] if is_in(name, other)]
        assert not back, f"{module.relative_to(ROOT)} imports {back}"


def test_every_way_to_import_is_seen() -> None:
    source = "import mujoco.viewer\nfrom sarsim import scripts\ndef f():\n    from dm_control.mjcf import Physics\n"
    assert set(imported(source)) == {"mujoco.viewer", "sarsim.scripts", "dm_control.mjcf.Physics"}
