"""How docstrings become pages: an extension of griffe, which reads them for mkdocstrings."""

import re
from typing import Any

import griffe

ROLE = re.compile(r":(?:class|func|meth|mod|attr|data):`~?([\w.]+)`")


class Docstrings(griffe.Extension):
    """Turns roles into links, and tells of an attribute once: in its class's list where that has it."""

    def on_package(self, *, pkg: griffe.Module, **kwargs: Any) -> None:
        """Rewrite the docstrings of a package and of all that it holds."""
        rewrite(pkg)


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
