"""The exception for invalid input from the user, errors as text, and checks of values, packages and settings."""

from collections.abc import Callable
from importlib.util import find_spec
from operator import ge, gt, lt
from typing import TypeVar

Value = TypeVar("Value")


class InputError(ValueError):
    """Invalid input. The message is one line that states the error and its place; commands exit with status 2."""


def required(value: Value | None) -> Value:
    """Return the value, or raise RuntimeError if it is None; unlike assertions, this works under ``python -O``."""
    if value is None:
        raise RuntimeError("a value that is needed here does not exist yet")
    return value


def require_package(package: str, extra: str, purpose: str) -> None:
    """Raise InputError unless a package that an ``extra`` provides is installed; ``purpose`` begins the message."""
    if find_spec(package) is None:
        raise InputError(f"{purpose} needs the package {package}; run: pip install 'sarsim[{extra}]'")


def one_line(error: BaseException) -> str:
    """Type and message of an error, on one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def require_positive(section: str, config: object, *fields: str) -> None:
    """Raise InputError unless the given ``fields`` of a ``section`` of the settings are all greater than 0."""
    _require(section, config, fields, gt, 0, "greater than 0")


def require_at_least(minimum: float, section: str, config: object, *fields: str) -> None:
    """Raise InputError unless the given ``fields`` of a ``section`` of the settings are all at least ``minimum``."""
    _require(section, config, fields, ge, minimum, f"at least {minimum:g}")


def require_between(low: float, high: float, section: str, config: object, *fields: str) -> None:
    """Raise InputError unless the given ``fields`` of a ``section`` of the settings are all between two bounds."""
    rule = f"greater than {low:g} and less than {high:g}"
    _require(section, config, fields, gt, low, rule)
    _require(section, config, fields, lt, high, rule)


def _require(
    section: str,
    config: object,
    fields: tuple[str, ...],
    holds: Callable[[float, float], bool],
    bound: float,
    rule: str,
) -> None:
    for field in fields:
        value = getattr(config, field)
        if not holds(value, bound):
            raise InputError(f"{section}.{field} = {value}: must be {rule}")
