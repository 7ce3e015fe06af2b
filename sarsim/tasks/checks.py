"""Checks of the actions, options and settings that a task receives; invalid values raise a one-line InputError."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

CLOSED = "the task is closed; create a new one with gymnasium.make"
NOT_RESET = "the task has not been reset; call reset() before step()"
USED = "a task that has been reset cannot be copied or pickled; create a new one and reset it with the same seed"
Weights = TypeVar("Weights")


def numbers_of(action: object, size: int) -> NDArray[np.float64]:
    """An action of ``size`` numbers; InputError if it has another shape or is not finite."""
    try:
        numbers = np.asarray(action, np.float64)
    except (TypeError, ValueError):
        numbers = np.full(0, np.nan)
    if numbers.shape != (size,) or not np.isfinite(numbers).all():
        raise InputError(f"action = {' '.join(str(action).split())[:60]}: must be {size} finite numbers")
    return numbers


def choice_of(action: object) -> int:
    """An action that is the number of a viewpoint; InputError if it is not a non-negative whole number."""
    number = np.asarray(action)
    if number.size != 1 or number.dtype.kind not in "iu" or number.item() < 0:
        raise InputError(f"action = {' '.join(str(action).split())[:60]}: must be a whole number from 0 on")
    return int(number.item())


def check_options(options: Mapping[str, Any] | None, known: tuple[str, ...] = ()) -> None:
    """Raise InputError unless all options of a reset are known."""
    unknown = [str(name) for name in options or {} if name not in known]
    if unknown:
        accepted = f"the options are {', '.join(known)}" if known else "there are none"
        raise InputError(f"reset: no option {', '.join(unknown)}; {accepted}")


def weights_of(kind: type[Weights], given: Weights | Mapping[str, float]) -> Weights:
    """The weights of a reward; InputError if a name is unknown or a number is not finite."""
    names = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    values = dict(given) if isinstance(given, Mapping) else {name: getattr(given, name) for name in names}
    if unknown := [name for name in values if name not in names]:
        raise InputError(f"weights: no weight {', '.join(unknown)}; the weights are {', '.join(names)}")
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not np.isfinite(value):
            raise InputError(f"weights: {name} = {value}: must be a finite number")
    return kind(**values)


def check_choice(name: str, value: object, choices: tuple[object, ...]) -> None:
    """Raise InputError unless a setting is one of its choices."""
    if value not in choices:
        raise InputError(f"{name} = {value!r}: must be {' or '.join(map(repr, choices))}")
