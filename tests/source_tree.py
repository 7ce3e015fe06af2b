"""The project's modules as syntax trees, and what they import."""

import ast
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

ROOT = Path(__file__).parents[1]


@dataclass(frozen=True)
class Module:
    """A module; ``name`` is dotted, as it is imported from the root of the checkout."""

    name: str
    text: str

    @cached_property
    def tree(self) -> ast.Module:
        """Its syntax tree."""
        return ast.parse(self.text)

    @cached_property
    def nodes(self) -> list[ast.AST]:
        """All of the tree."""
        return list(ast.walk(self.tree))

    @cached_property
    def imports(self) -> list[str]:
        """Dotted names that it imports, at the top or inside a function."""
        found: list[str] = []
        for node in self.nodes:
            if isinstance(node, ast.Import):
                found += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                found += [f"{node.module}.{alias.name}" for alias in node.names]
        return found


@cache
def modules(*packages: str) -> list[Module]:
    """The modules of packages."""
    if len(packages) > 1:
        return [module for package in packages for module in modules(package)]
    paths = sorted(ROOT.joinpath(*packages).rglob("*.py"))
    return [Module(dotted(path), path.read_text()) for path in paths]


def dotted(path: Path) -> str:
    """The name that a module is imported by."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
