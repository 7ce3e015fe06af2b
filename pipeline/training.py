"""What all trainings share: how the learning rate goes, and checkpoints from which they are taken up again."""

import pickle
from collections.abc import Callable
from math import cos, pi
from pathlib import Path
from typing import Any

import torch

from pipeline.errors import InputError
from pipeline.files import whole_file


def schedule(progress: float, warm_up: float) -> float:
    """The learning rate as a share of the highest, at a progress from 0 to 1: it rises, then falls as a cosine."""
    if progress < warm_up:
        return progress / warm_up
    return (1 + cos(pi * (progress - warm_up) / (1 - warm_up))) / 2


def save_checkpoint(path: Path, settings: str, state: dict[str, Any]) -> None:
    """Write a training's state, and the settings that it holds for.

    Raises:
        InputError: the file cannot be written.
    """
    with whole_file(path) as file:
        torch.save({"settings": settings} | state, file)


def resume(
    path: Path, settings: str, device: torch.device, restore: Callable[[dict[str, Any]], object]
) -> None:
    """Hand the state that :func:`save_checkpoint` wrote to ``restore``, its tensors on ``device``.

    Raises:
        InputError: the file is none of a training with these settings, or ``restore`` misses something in it.
    """
    try:
        state = torch.load(path, map_location=device, weights_only=True)
        if state["settings"] != settings:
            raise InputError(
                f"{path} is of a training with other settings or data: remove it, or choose another --out"
            )
        restore(state)
    except (OSError, RuntimeError, KeyError, TypeError, EOFError, pickle.UnpicklingError) as error:
        raise InputError(
            f"{path}: not a checkpoint of this program: remove it, or choose another --out"
        ) from error
