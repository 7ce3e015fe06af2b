"""The exception for invalid input from the user, errors as text, and the check of what a method needs."""

from typing import TypeVar

Value = TypeVar("Value")


class InputError(ValueError):
    """Invalid input. The message is one line that says what is wrong and where; commands exit with status 2."""


def required(value: Value | None) -> Value:
    """The value; raises RuntimeError if it is None. Unlike an assertion, this also holds under ``python -O``."""
    if value is None:
        raise RuntimeError("a value that is needed here does not exist yet")
    return value


def one_line(error: BaseException) -> str:
    """Type and message of an error, in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
