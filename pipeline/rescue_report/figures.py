"""List the figures of a report, whatever the depth of nesting, and format them as text."""

from collections.abc import Iterator, Mapping
from typing import Any


def figures(name: str, content: Any) -> Iterator[tuple[str, Any]]:
    """Yield the name and value of each figure in nested mappings.

    A name consists of ``name`` and the keys that lead to the value, joined by dots. Lists of records, which are meant
    for programs, are left out.
    """
    if isinstance(content, Mapping):
        for key, value in content.items():
            yield from figures(f"{name}.{key}", value)
    elif not (isinstance(content, list) and content and isinstance(content[0], Mapping)):
        yield name, content


def figure_text(value: float) -> str:
    """A figure with three significant digits or, if its absolute value is 1000 or more, as an integer."""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
