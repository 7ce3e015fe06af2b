"""Common parts of all commands: flags from typed parameters, and one-line messages on stderr for wrong input."""

import argparse
import functools
import inspect
import io
import logging
import os
import re
import select
import signal
import stat
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr
from difflib import get_close_matches
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from types import FrameType
from typing import Any, Self, TypeVar

import tyro
from rich.progress import Progress as Bars

from pipeline.errors import InputError
from pipeline.progress import Progress
from sarsim.arenas.names import BUILT_IN, check_arena_name
from sarsim.flags import FLAG_TYPES
from sarsim.methods.names import check_method
from sarsim.progress import progress_bars, shown_run
from sarsim.robots.names import robot_file
from sarsim.settings import METHODS, is_own_arena
from sarsim.startup import prepare_process

BAD_INPUT = 2
TERMINATION_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals sent by Ctrl-C, service managers, containers and a closed terminal; all end a command in the same way."""
SIGNAL_STATUS_OFFSET = 128  # Exit status after a signal, minus the signal's number, as in shells
SIGPIPE_STATUS = 141  # Exit status if the output has no reader: 128 + SIGPIPE
HELP_INDENT = 8 * " "  # Indentation of a flag's help in tyro's messages about wrong flags
COMMON_FLAGS_HELP = (
    "Every command also accepts --version, --quiet (only errors), --verbose (all figures) and "
    "--log-level debug|info|warning|error."
)
INPUT_PATH_FLAGS = ("data", "detector", "detector-names", "init", "map", "path", "weights")
"""Settings that name files or folders to read."""
Item = TypeVar("Item")
_quiet = _verbose = False


def is_verbose() -> bool:
    """Whether the command line contains ``--verbose``."""
    return _verbose


def run(command: Callable[..., object], args: Sequence[str] | None = None) -> None:
    """Call ``command`` with its parameters taken from ``args``, by default the command line.

    Wrong flags and :class:`pipeline.errors.InputError` end the process with status 2, Ctrl-C with status 130,
    SIGTERM with 143 and a closed terminal with 129, each with a message on stderr.
    """

    @functools.wraps(command)
    def bind(*args: Any, **kwargs: Any) -> functools.partial[object]:
        return functools.partial(command, *args, **kwargs)

    def action() -> None:
        words = apply_common_flags(args)  # before tyro's stderr is captured
        about = f"{(inspect.getdoc(command) or '').partition('Args:')[0]}\n\n{COMMON_FLAGS_HELP}"
        bound = parse(lambda: tyro.cli(bind, prog=program(), args=words, description=about))
        check_names(bound.keywords)
        bound()

    run_guarded(action)


def apply_common_flags(args: Sequence[str] | None = None) -> list[str]:
    """Apply the flags of :data:`COMMON_FLAGS_HELP`, and return the other words of the command line.

    Raises:
        InputError: one of these flags is wrong.
    """
    global _quiet, _verbose
    flags = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    flags.add_argument("--version", action="store_true")
    output = flags.add_mutually_exclusive_group()
    output.add_argument("--quiet", action="store_true")
    output.add_argument("--verbose", action="store_true")
    flags.add_argument("--log-level", choices=("debug", "info", "warning", "error"), default="warning")
    words = list(sys.argv[1:] if args is None else args)
    for flag, value in pairwise(["", *words]):
        if not _is_text(value):
            raise InputError(f"{value!a}: is not text in this locale; choose a UTF-8 locale, as by LC_ALL=C.UTF-8")
        if re.fullmatch("--[^=]*=", value):
            raise InputError(f"{value}: the value must not be empty")
        if not value:
            raise InputError(f"{flag if flag.startswith('-') else 'argument'} '': must not be empty")
    try:
        given, rest = flags.parse_known_args(words)
    except argparse.ArgumentError as error:
        raise InputError(str(error)) from None
    if given.version:
        print("sarsim", version("sarsim"))
        raise SystemExit
    _quiet, _verbose = given.quiet, given.verbose
    if _quiet:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    level = "error" if given.quiet else given.log_level
    logging.getLogger("absl").setLevel(logging.ERROR)  # hides messages of MuJoCo and dm_control below errors
    logging.basicConfig(format="%(levelname)s %(name)s: %(message)s", level=level.upper())
    return rest


def program() -> str:
    """The command's name for messages: the path by which it was called, or only the last part of an absolute path."""
    called = Path(sys.argv[0])
    return called.name if called.is_absolute() else str(called)


def _is_text(word: str) -> bool:
    """Whether a word of the command line could be decoded.

    Other programs cannot open a file whose name cannot be decoded.
    """
    try:
        word.encode()
    except UnicodeEncodeError:
        return False
    return True


def check_arena(name: str) -> None:
    """Raise InputError if ``--arena`` names no arena; avoid imports that take seconds."""
    if name not in BUILT_IN and is_own_arena(name):
        check_method("arena", name if ":" in name else name.partition("/")[0])
    else:
        check_arena_name(name)


def check_names(settings: Mapping[str, Any]) -> None:
    """Check the settings that name an arena, a robot, methods, or files to read, before imports that take seconds.

    Raises:
        InputError: one of the names does not exist.
    """
    for name, value in settings.items():
        flag = name.replace("_", "-")
        values = value if isinstance(value, tuple) else (value,)
        if flag == "arena":
            check_arena(value)
        elif flag == "robot" and value is not None:
            robot_file(value)
        elif flag in METHODS and flag not in ("arena", "arenas", "methods"):
            for method in values:
                if isinstance(method, str):
                    check_method(flag, method)
        elif flag in INPUT_PATH_FLAGS:
            for path in values:
                if isinstance(path, Path) and not path.exists():
                    raise InputError(f"{'' if flag == 'path' else f'--{flag} '}{path}: no such file or folder")


def parse(command_line: Callable[[], Any]) -> Any:
    """Call one of tyro's parsers, and turn its boxed message about wrong flags into an InputError."""
    message = io.StringIO()
    try:
        with redirect_stderr(message), FLAG_TYPES:
            return command_line()
    except SystemExit as exit:
        if exit.code != BAD_INPUT:
            raise
        raise InputError(unboxed(message.getvalue())) from None


def unboxed(text: str) -> str:
    """The text of tyro's error box as one line: the message and the suggested flags, without the flags' help."""
    inside = [line[2:].rstrip(" │") for line in text.splitlines()[1:]]  # without the title and the border
    lines = [line.strip() for line in inside if not line.startswith(HELP_INDENT)]
    parts = [part.strip() for part in re.split("(?m)^[─-]{3,}╯?$", "\n".join(lines))]
    suggestions = [part for part in parts if part.startswith(("Perhaps you meant", "Arguments similar"))]
    flags = [flag for part in suggestions for flag in re.findall(r"^--[\w.-]+", part, re.MULTILINE)]
    said = [part for part in parts if part not in suggestions and not part.startswith("For full helptext")]
    wrong = [flag for part in said if part.startswith("Unrecognized") for flag in re.findall(r"--[\w.-]+", part)]
    missing = [flag for part in said if part.startswith("Missing") for flag in re.findall(r"--[\w.-]+", part)]
    # If a required flag is missing, tyro does not suggest it for an unknown flag.
    flags = flags or [flag for word in wrong for flag in get_close_matches(word, missing)]
    errors = re.sub(r"\. Got errors: .*", "", "; ".join(" ".join(part.split()) for part in said if part))
    errors = re.sub(r"^Error parsing \w+: ", "", errors)  # users do not know the class of a plug-in's settings
    return errors + (f"; perhaps you meant {' or '.join(flags)}" if flags else "")


def progress(disable: bool = False, transient: bool = False) -> Bars:
    """A progress bar on stderr, with counts and elapsed time; lines if stderr is not a terminal.

    ``transient``: whether the bar disappears at the end.
    """
    announce_compilation()
    return progress_bars(disable or _quiet, transient)


def tracked(items: Iterable[Item], description: str) -> Iterator[Item]:
    """Yield the items, and show a progress bar that disappears after the last item."""
    with progress(transient=True) as bars:
        yield from bars.track(items, description=description)


@functools.cache
def announce_compilation() -> None:
    """Print a line in a terminal when numba starts to compile, which takes minutes; later runs use numba's cache."""
    from numba.core import event

    class Announcer(event.Listener):
        is_announced = _quiet or not sys.stderr.isatty()

        def on_start(self, event: event.Event) -> None:
            if not self.is_announced:
                self.is_announced = True
                print(
                    "compiling for this machine; the first run takes a few minutes longer",
                    file=sys.stderr,
                    flush=True,
                )

        def on_end(self, event: event.Event) -> None:
            """Print nothing."""

    event.register("numba:compile", Announcer())


def check_parent_folder(flag: str, path: Path) -> None:
    """Raise InputError if the parent folder of the file ``path`` does not exist."""
    if not path.absolute().parent.is_dir():
        raise InputError(f"--{flag} {path}: the folder {path.absolute().parent} does not exist; create it first")


def run_guarded(action: Callable[[], object]) -> None:
    """Run ``action`` in a prepared process.

    Bad input or one of :data:`TERMINATION_SIGNALS` ends the process with a one-line message and an exit status. If
    the program that reads the output stops reading, as ``head`` does, the process ends without a message.
    """
    prepare_process()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # in the locale's encoding, which may lack characters
            stream.reconfigure(errors="backslashreplace")
    try:
        with _signals_as_interrupts():
            try:
                action()
            finally:
                sys.stdout.flush()
    except (InputError, ExceptionGroup) as error:
        failures = error.exceptions if isinstance(error, ExceptionGroup) else [error]
        if not all(isinstance(failure, InputError) for failure in failures):  # A bug is among them
            raise
        for failure in failures:
            print(" ".join(f"error: {failure}".split()), file=sys.stderr)
        sys.exit(BAD_INPUT)
    except KeyboardInterrupt as interrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(SIGNAL_STATUS_OFFSET + (interrupt.args or (signal.SIGINT,))[0])
    except BrokenPipeError:
        if not _has_lost_reader():
            raise
        # Python flushes the remaining output at exit, which would fail.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(SIGPIPE_STATUS)


def _has_lost_reader() -> bool:
    """Whether stdout has lost its reader; a BrokenPipeError may also come from another pipe."""
    poll = select.poll()
    poll.register(sys.stdout.fileno(), 0)  # poll always reports errors
    return bool(poll.poll(0))


@contextmanager
def _signals_as_interrupts() -> Iterator[None]:
    """Make all :data:`TERMINATION_SIGNALS` raise KeyboardInterrupt unless ignored, as SIGHUP is under ``nohup``.

    SIGINT raises KeyboardInterrupt even if ignored, because ``kill -INT`` should end background jobs, which shells
    without job control start with SIGINT ignored.
    """
    before = {number: signal.getsignal(number) for number in TERMINATION_SIGNALS}
    for number, handler in before.items():
        if handler == signal.SIG_DFL or (number, handler) == (signal.SIGINT, signal.SIG_IGN):
            signal.signal(number, interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def interrupt(number: int, frame: FrameType | None = None) -> None:
    """Raise KeyboardInterrupt with the signal's number."""
    if number == signal.SIGHUP:
        forget_terminal()
    raise KeyboardInterrupt(number)


def forget_terminal() -> None:
    """Redirect output from the terminal to /dev/null, because writing to a closed terminal would fail."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        if stat.S_ISCHR(os.fstat(stream).st_mode):  # isatty is false for a closed terminal
            os.dup2(nowhere, stream)


class SignalRecorder:
    """Records the first of :data:`TERMINATION_SIGNALS`, so that a step can end; a second signal interrupts the step.

    Attributes:
        signal: number of the first signal; None if none has arrived in the ``with`` block.
    """

    def __init__(self) -> None:
        self.signal: int | None = None

    def __enter__(self) -> Self:
        self._before = {number: signal.getsignal(number) for number in TERMINATION_SIGNALS}
        for number, handler in self._before.items():
            if handler != signal.SIG_IGN:
                signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.signal is not None:
            interrupt(number)
        if number == signal.SIGHUP:
            forget_terminal()
        self.signal = number


def run_watched(
    run: Callable[[Callable[[], bool], Callable[[Progress], None]], object], description: str
) -> int | None:
    """Call ``run``, show its progress, and return the number of the signal that ended it, if there was one.

    ``run`` must end when its first argument returns True, and must pass its progress to its second argument.
    """
    announce_compilation()
    with shown_run(description, _quiet) as show, SignalRecorder() as control:
        run(lambda: control.signal is not None, show)
    return control.signal


def exit_by_signal(number: int | None) -> None:
    """End the process with the status of a signal, if one ended the command."""
    if number:
        raise SystemExit(SIGNAL_STATUS_OFFSET + number)
