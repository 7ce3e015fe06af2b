"""The figures of a report, whatever they are nested in."""

from collections.abc import Iterator, Mapping
from typing import Any


def figures(name: str, content: Any) -> Iterator[tuple[str, Any]]:
    """The values in nested mappings, with their path of keys as name; lists of records are for programs alone."""
    if isinstance(content, Mapping):
        for key, value in content.items():
            yield from figures(f"{name}.{key}", value)
    elif not (isinstance(content, list) and content and isinstance(content[0], Mapping)):
        yield name, content
