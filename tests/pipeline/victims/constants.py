"""Sets a module's constants to other values inside a with block."""

from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

import pytest


@contextmanager
def constants(module: ModuleType, **values: object) -> Iterator[None]:
    """Set constants of a module, which must exist, and set them back at the end."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in values.items():
            patch.setattr(module, name, value)
        yield
