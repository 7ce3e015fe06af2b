"""The figures of a report, at any depth of nesting, and as text."""

from collections.abc import Iterator, Mapping
from typing import Any


def figures(name: str, content: Any) -> Iterator[tuple[str, Any]]:
    """The values in nested mappings, named by their paths of keys; lists of records (for programs) are left out."""
    if isinstance(content, Mapping):
        for key, value in content.items():
            yield from figures(f"{name}.{key}", value)
    elif not (isinstance(content, list) and content and isinstance(content[0], Mapping)):
        yield name, content


def figure_text(value: float) -> str:
    """A figure to three significant digits or, if 1000 or more, as an integer."""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
