"""Files that are either whole or not there, and checkpoints from which a training is taken up again."""

import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError

if TYPE_CHECKING:
    import torch  # where it is needed it is imported then: most who write files do not train


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Lend the path of a new file beside ``path``, which takes its place when the block ends without an error.

    Raises:
        InputError: the file cannot be written.
    """
    partial = path.with_name(path.name + ".part")
    try:
        yield partial
        partial.replace(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with suppress(OSError):
            partial.unlink()


def save_checkpoint(path: Path, settings: str, state: dict[str, Any]) -> None:
    """Write a training's state, and the settings that it holds for.

    Raises:
        InputError: the file cannot be written.
    """
    import torch

    with whole_file(path) as file:
        torch.save({"settings": settings} | state, file)


def resume(path: Path, settings: str, device: "torch.device", restore: Callable[[dict[str, Any]], object]) -> None:
    """Hand the state that :func:`save_checkpoint` wrote to ``restore``, its tensors on ``device``.

    Raises:
        InputError: the file is none of a training with these settings, or ``restore`` misses something in it.
    """
    import torch

    remedy = "remove it, or choose another --out"
    try:
        state = torch.load(path, map_location=device, weights_only=True)
        if state["settings"] != settings:
            raise InputError(f"{path} is of a training with other settings or data: {remedy}")
        restore(state)
    except (OSError, RuntimeError, KeyError, TypeError, EOFError, pickle.UnpicklingError) as error:
        raise InputError(f"{path}: not a checkpoint of this program: {remedy}") from error
