"""What all commands share: flags from typed parameters, and one line for what the user got wrong."""

import sys
from collections.abc import Callable, Sequence

import tyro

from pipeline.errors import InputError

BAD_INPUT = 2
INTERRUPTED = 130  # 128 + SIGINT, as shells have it


def run(command: Callable[..., object], args: Sequence[str] | None = None) -> None:
    """Call ``command`` with its parameters taken from the command line (or from ``args``).

    Wrong flags and :class:`pipeline.errors.InputError` end the process with status 2, Ctrl-C with status 130, each
    with a message on stderr.
    """
    guarded(lambda: tyro.cli(command, args=args))


def guarded(action: Callable[[], object]) -> None:
    """Run ``action``; turn bad input and Ctrl-C into one line on stderr and an exit status."""
    try:
        action()
    except InputError as error:
        _exit(f"error: {error}", BAD_INPUT)
    except KeyboardInterrupt:
        _exit("interrupted", INTERRUPTED)


def _exit(message: str, status: int) -> None:
    print(" ".join(message.split()), file=sys.stderr)
    sys.exit(status)
