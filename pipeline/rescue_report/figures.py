"""The figures of a report, however deeply they are nested."""

from collections.abc import Iterator, Mapping
from typing import Any


def figures(name: str, content: Any) -> Iterator[tuple[str, Any]]:
    """The values in nested mappings, named by their path of keys, without lists of records (meant for programs)."""
    if isinstance(content, Mapping):
        for key, value in content.items():
            yield from figures(f"{name}.{key}", value)
    elif not (isinstance(content, list) and content and isinstance(content[0], Mapping)):
        yield name, content
