"""The project's modules as syntax trees: what they import, how long they are, what they document."""

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

ROOT = Path(__file__).parents[1]
LAYOUT = frozenset(
    [tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER]
)
"""Tokens that are no code."""


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

    @cached_property
    def code_lines(self) -> set[int]:
        """Numbers of the lines that hold code: neither blank nor a comment nor a docstring alone."""
        tokens = tokenize.generate_tokens(io.StringIO(self.text).readline)
        spans = [(token.start[0], token.end[0]) for token in tokens if token.type not in LAYOUT]
        lines = {line for first, last in spans for line in range(first, last + 1)}
        strings = [node for node in self.nodes if isinstance(node, ast.Expr) and is_text(node.value)]
        return lines - {line for node in strings for line in range(node.lineno, node.end_lineno + 1)}

    def length(self, node: ast.stmt) -> int:
        """Lines of code of a function or class, its first line included."""
        return sum(node.lineno <= line <= node.end_lineno for line in self.code_lines)


def is_text(node: ast.AST) -> bool:
    """Whether it is a string as written."""
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


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


ALIASES = frozenset(re.findall(r"^(\w+): TypeAlias", (ROOT / "pipeline" / "arrays.py").read_text(), re.MULTILINE))
"""Names of arrays whose shape and unit stand in :mod:`pipeline.arrays`."""


@dataclass(frozen=True)
class PublicFunction:
    """A function or method without an underscore in its name or its class's.

    Attributes:
        name: dotted, with the module.
        node: of the syntax tree.
        outer: the class that it is a method of, and its docstring; both empty for a function.
    """

    name: str
    node: ast.FunctionDef
    outer: tuple[str, str] = ("", "")

    @property
    def doc(self) -> str:
        """Its docstring, and that of its class if it makes an object of it."""
        own, (outer, text) = ast.get_docstring(self.node) or "", self.outer
        makes = self.node.returns is not None and ast.unparse(self.node.returns).strip("'") in (outer, "Self")
        return f"{own}\n{text}" if makes else own

    @property
    def parameters(self) -> list[ast.arg]:
        """All but ``self``."""
        a = self.node.args
        named = [*a.posonlyargs, *a.args, *a.kwonlyargs, *filter(None, (a.vararg, a.kwarg))]
        return [parameter for parameter in named if parameter.arg not in ("self", "cls")]

    @property
    def types(self) -> str:
        """The annotations of its parameters and its result."""
        notes = [*(parameter.annotation for parameter in self.parameters), self.node.returns]
        return " ".join(ast.unparse(note) for note in notes if note)

    @property
    def passes_arrays(self) -> bool:
        """Whether arrays go in or out; those of a compiled function, which has no types, are what it indexes."""
        names = {parameter.arg for parameter in self.parameters if not parameter.annotation}
        indexed = (node.value for node in ast.walk(self.node) if isinstance(node, ast.Subscript))
        words = set(re.findall(r"\w+", self.types))
        return bool(words & (ALIASES | {"NDArray"})) or any(
            isinstance(n, ast.Name) and n.id in names for n in indexed
        )


def public_functions(module: Module) -> Iterator[PublicFunction]:
    """Functions of a module and methods of its classes that others may call."""
    for node in module.tree.body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            yield PublicFunction(f"{module.name}.{node.name}", node)
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            outer = node.name, ast.get_docstring(node) or ""
            methods = (item for item in node.body if isinstance(item, ast.FunctionDef))
            for method in methods:
                if not method.name.startswith("_"):
                    yield PublicFunction(f"{module.name}.{node.name}.{method.name}", method, outer)
