"""How docstrings become pages: an extension of griffe, which reads them for mkdocstrings."""

import ast
import re
import tokenize
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import griffe

ROLE = re.compile(r":(?:class|func|meth|mod|attr|data):`~?([\w.]+)`")
NO_TEXT = re.compile(r"# *(fmt|noqa|type):")
"""Comments for tools."""


class Docstrings(griffe.Extension):
    """Turns roles into links, adds constants assigned in pairs and what is said behind constants.

    It lists an attribute of a class once.
    """

    def on_module_members(self, *, node: ast.Module, mod: griffe.Module, **kwargs: Any) -> None:
        """Add the names of ``A, B = 1, 2``, which griffe passes over, and comments behind constants."""
        for name, attribute in paired_constants(node):
            mod.set_member(name, attribute)
        for name, text in comments_behind(node, Path(mod.filepath)):
            if name in mod.members and not mod.members[name].docstring:
                mod.members[name].docstring = griffe.Docstring(text, parser="google")

    def on_package(self, *, pkg: griffe.Module, **kwargs: Any) -> None:
        """Rewrite the docstrings of a package and of all that it holds."""
        rewrite(pkg)


def paired_constants(module: ast.Module) -> Iterator[tuple[str, griffe.Attribute]]:
    """The names of assignments to several names, each with its value and the docstring of all."""
    for statement, after in pairwise([*module.body, ast.Pass()]):
        if not (isinstance(statement, ast.Assign) and isinstance(names := statement.targets[0], ast.Tuple)):
            continue
        values = statement.value.elts if isinstance(statement.value, ast.Tuple) else []
        for k, name in enumerate(names.elts):
            if isinstance(name, ast.Name):
                value = ast.unparse(values[k]) if len(values) == len(names.elts) else None
                attribute = griffe.Attribute(name.id, value=value, lineno=name.lineno, endlineno=name.end_lineno)
                attribute.docstring = docstring_of(after)
                attribute.labels.add("module-attribute")
                yield name.id, attribute


def comments_behind(module: ast.Module, path: Path) -> Iterator[tuple[str, str]]:
    """The names of a module's constants and the comments that stand behind them on the same line."""
    with tokenize.open(path) as file:
        tokens = [t for t in tokenize.generate_tokens(file.readline) if t.type == tokenize.COMMENT]
    comments = {t.start[0]: t.string.removeprefix("#").strip() for t in tokens if not NO_TEXT.match(t.string)}
    for statement in module.body:
        if isinstance(statement, ast.Assign | ast.AnnAssign) and statement.end_lineno in comments:
            targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
            for name in (n for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)):
                yield name.id, f"{comments[statement.end_lineno]}."


def docstring_of(statement: ast.stmt) -> griffe.Docstring | None:
    """The docstring that a statement is, if it is one."""
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
        return griffe.Docstring(str(statement.value.value), lineno=statement.lineno, parser="google")
    return None


def rewrite(parent: griffe.Object) -> None:
    """Rewrite the docstrings of a module or class and of its members."""
    link_roles(parent)
    for name, member in list(parent.members.items()):
        if isinstance(member, griffe.Object):
            if member.is_attribute and is_listed(name, parent) and not member.docstring:
                del parent.members[name]
            rewrite(member)


def link_roles(documented: griffe.Object) -> None:
    """Make a link, which mkdocstrings resolves in the docstring's scope, of ``:class:`Name``` and its like."""
    if documented.docstring:
        documented.docstring.value = ROLE.sub(r"[`\1`][\1]", documented.docstring.value)


def is_listed(name: str, parent: griffe.Object) -> bool:
    """Whether the ``Attributes:`` of a class describe an attribute."""
    text = parent.docstring.value if parent.docstring else ""
    return bool(re.search(rf"^\s+(\w+, )*{name}(, \w+)*( \(.*\))?:", text, re.MULTILINE))
