"""Types of the fields that become flags."""

from typing import Annotated, TypeVar

import tyro

Value = TypeVar("Value")
Given = Annotated[Value | None, tyro.conf.arg(help_behavior_hint="")]
"""A value, or None if the flag is not given; its help describes that case, so ``(default: None)`` is omitted."""
