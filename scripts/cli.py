"""What all commands share: flags from typed parameters, and one line for what the user got wrong."""

import functools
import io
import os
import re
import select
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr
from types import FrameType
from typing import Any, Self

import tyro

from pipeline.errors import InputError

BAD_INPUT = 2
INTERRUPTED = 130  # 128 + SIGINT, as shells have it
UNREAD = 141  # 128 + SIGPIPE


def run(command: Callable[..., object], args: Sequence[str] | None = None) -> None:
    """Call ``command`` with its parameters taken from the command line (or from ``args``).

    Wrong flags and :class:`pipeline.errors.InputError` end the process with status 2, Ctrl-C with status 130, each
    with a message on stderr.
    """

    @functools.wraps(command)
    def bind(*args: Any, **kwargs: Any) -> functools.partial[object]:
        return functools.partial(command, *args, **kwargs)

    guarded(lambda: parse(lambda: tyro.cli(bind, args=args))())


def parse(command_line: Callable[[], Any]) -> Any:
    """Call one of tyro's parsers; its boxed messages about wrong flags become InputError."""
    message = io.StringIO()
    try:
        with redirect_stderr(message):
            return command_line()
    except SystemExit as exit:
        if exit.code != BAD_INPUT:
            raise
        raise InputError(unboxed(message.getvalue())) from None


def unboxed(text: str) -> str:
    """What a box of tyro's says above its first rule, as one line."""
    lines = [re.sub("[╭╮╰╯│─]", " ", line).strip() for line in text.splitlines()[1:]]
    said = "\n".join(lines).strip().split("\n\n")[0]
    return " ".join(said.split())


def guarded(action: Callable[[], object]) -> None:
    """Run ``action``; turn bad input and Ctrl-C into one line on stderr and an exit status.

    If whoever reads the output has enough, as ``head`` does, the process ends without a word.
    """
    try:
        try:
            action()
        finally:
            sys.stdout.flush()
    except InputError as error:
        _exit(f"error: {error}", BAD_INPUT)
    except KeyboardInterrupt:
        _exit("interrupted", INTERRUPTED)
    except BrokenPipeError:
        if not _is_unread():
            raise
        # Python flushes what is left when it ends, and would complain.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(UNREAD)


def _is_unread() -> bool:
    """Whether nobody is left at the other end of stdout; the pipe that broke may be another one."""
    poll = select.poll()
    poll.register(sys.stdout.fileno(), 0)  # errors are told of unasked
    return bool(poll.poll(0))


class Interruptible:
    """Holds Ctrl-C back while a step is under way, so that what it changes stays of one piece; a second one does not.

    Attributes:
        interrupted: whether Ctrl-C was pressed since ``with``.
    """

    def __init__(self) -> None:
        self.interrupted = False

    def __enter__(self) -> Self:
        self._before = signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        signal.signal(signal.SIGINT, self._before)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.interrupted:
            raise KeyboardInterrupt
        self.interrupted = True


def _exit(message: str, status: int) -> None:
    print(" ".join(message.split()), file=sys.stderr)
    sys.exit(status)
