"""Types of the fields that become flags, and how their values are shown."""

import re
from dataclasses import replace
from types import NoneType
from typing import Annotated, TypeVar, get_args

import tyro
from tyro.constructors import (
    ConstructorRegistry,
    PrimitiveConstructorSpec,
    PrimitiveTypeInfo,
    UnsupportedTypeAnnotationError,
)

Value = TypeVar("Value")


def _default_hint(value: str) -> str:
    return "" if value == "None" else f"(default: {value})"


Given = Annotated[Value | None, tyro.conf.arg(help_behavior_hint=_default_hint)]
"""A value, or None if the flag is not given; the flag's help describes that case and omits ``(default: None)``."""
FLAG_TYPES = ConstructorRegistry()
"""Context in which tyro shows an optional path as ``PATH``, not as ``{None}|PATH``; ``None`` is still accepted."""


@FLAG_TYPES.primitive_rule
def _shown_without_none(flag: PrimitiveTypeInfo) -> PrimitiveConstructorSpec | UnsupportedTypeAnnotationError | None:
    values = get_args(flag.type)
    has_parts_of_none = any(NoneType in get_args(part) for value in values for part in get_args(value))
    if NoneType not in values or has_parts_of_none or tyro.conf.DisallowNone in flag.markers:
        return None
    value = ConstructorRegistry.get_primitive_spec(replace(flag, markers=flag.markers | {tyro.conf.DisallowNone}))
    if isinstance(value, UnsupportedTypeAnnotationError):
        return value
    parse = value.instance_from_str
    return replace(
        value,
        metavar=re.sub("^{([^{}]* [^{}]*)}$", r"\1", value.metavar),  # several numbers need no braces of their own
        instance_from_str=lambda words: None if words == ["None"] else parse(words),
    )
