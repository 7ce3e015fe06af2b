"""Exit statuses and the one line on stderr."""

import functools
import os
import pty
import signal
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

import pytest

from pipeline.errors import InputError
from pipeline.progress import Progress
from sarsim import progress as progress_module
from sarsim.commands.cli import progress, run, run_watched, tracked
from sarsim.progress import shown_run


def command(count: int, *, fail: str = "", pair: tuple[int, int] | None = None) -> None:
    """Do something ``count`` times."""
    if fail == "input":
        raise InputError(f"count {count}\n  is too much")
    if fail == "both":
        raise ExceptionGroup("both", [InputError("a.ply: no room"), InputError("b.npz:\n  no room")])
    if fail == "interrupt":
        raise KeyboardInterrupt
    if fail == "pipe":
        raise BrokenPipeError("not of stdout")
    print("done", count)


def exit_status(args: list[str]) -> int | str | None:
    with pytest.raises(SystemExit) as raised:
        run(command, args)
    return raised.value.code


def test_bad_input_is_one_line_and_status_2(capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_status(["--count", "3", "--fail", "input"]) == 2
    captured = capsys.readouterr()
    assert captured.err == "error: count 3 is too much\n"
    assert captured.out == ""


def test_each_of_several_failures_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_status(["--count", "3", "--fail", "both"]) == 2
    assert capsys.readouterr().err == "error: a.ply: no room\nerror: b.npz: no room\n"


def test_ctrl_c_is_one_line_and_status_130(capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_status(["--count", "3", "--fail", "interrupt"]) == 130
    assert capsys.readouterr().err == "interrupted\n"


@pytest.mark.parametrize(
    ("ending", "before", "status"),
    [
        (signal.SIGTERM, signal.SIG_DFL, 143),
        (signal.SIGHUP, signal.SIG_DFL, 129),
        (signal.SIGINT, signal.SIG_IGN, 130),  # of a script's background job
    ],
)
def test_other_signals_end_a_command_as_ctrl_c_does(
    ending: signal.Signals,
    before: signal.Handlers,
    status: int,
    capsys: pytest.CaptureFixture[str],
    request: pytest.FixtureRequest,
) -> None:
    tidied: list[bool] = []
    request.addfinalizer(functools.partial(signal.signal, ending, signal.getsignal(ending)))
    signal.signal(ending, before)

    def long_command() -> None:
        try:
            signal.raise_signal(ending)
            time.sleep(60)
        finally:
            tidied.append(True)

    with pytest.raises(SystemExit) as raised:
        run(long_command, [])
    assert (raised.value.code, tidied, capsys.readouterr().err) == (status, [True], "interrupted\n")
    assert signal.getsignal(ending) == before


STEPS = """
import time
from importlib.metadata import version
from pathlib import Path
from pipeline.progress import Progress
from sarsim.commands.cli import exit_by_signal, run, run_watched

def take(interrupted, show):
    print("begun", flush=True)
    while not interrupted():
        time.sleep(0.02)
        show(Progress("a step"))

def steps(out: Path) -> None:
    ended_by = run_watched(take, "place")
    out.write_text(f"whole {ended_by}")
    exit_by_signal(ended_by)

run(steps)
"""


def test_a_closed_terminal_lets_the_step_end(tmp_path: Path) -> None:
    child, terminal = pty.fork()
    if not child:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)  # under nohup it is ignored
        os.execv(sys.executable, [sys.executable, "-c", STEPS, "--out", str(tmp_path / "result")])
    seen = b""
    while b"begun" not in seen:
        seen += os.read(terminal, 1000)
    os.close(terminal)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 129
    assert (tmp_path / "result").read_text() == "whole 1"


@pytest.mark.parametrize(
    ("args", "line"),
    [
        (["--count", "3", "--fali", "pipe"], "Unrecognized options: --fali, pipe; perhaps you meant --fail"),
        (["--fail", "pipe"], ": --count INT"),
        (["--count", "many"], "--count"),
        (["--count", "3", "--pair", "none"], "{INT INT} could be instantiated from ['none']"),
        (["--cuont", "3"], ": --count INT; Unrecognized options: --cuont 3; perhaps you meant --count"),
    ],
)
def test_the_flag_that_was_meant_is_named(args: list[str], line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_status(args) == 2
    (message,) = capsys.readouterr().err.splitlines()
    assert message.startswith("error: ") and line in message


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--count", "3", "--fail", ""], "--fail '': must not be empty"),
        (["--count", "3", "--fail="], "--fail=: the value must not be empty"),
        ([""], "argument '': must not be empty"),
        (["3", ""], "argument '': must not be empty"),
    ],
)
def test_nothing_is_no_value(args: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_status(args) == 2
    assert capsys.readouterr().err == f"error: {message}\n"


@pytest.mark.parametrize("args", ["--help", "--count 3"])
def test_a_pipe_without_a_reader_ends_the_process_without_a_message(args: str) -> None:
    program = f"from tests.sarsim.commands.test_cli import *; run(command, {args.split()})"
    reader, writer = os.pipe()
    os.close(reader)
    ended = subprocess.run([sys.executable, "-c", program], stdout=writer, stderr=subprocess.PIPE, text=True)
    os.close(writer)
    assert (ended.returncode, ended.stderr) == (141, "")


def test_another_pipe_that_breaks_is_an_error() -> None:
    with pytest.raises(BrokenPipeError, match="not of stdout"):
        run(command, ["--count", "3", "--fail", "pipe"])


def ended(
    args: list[str], program: str = "from tests.sarsim.commands.test_cli import *; run(command, {})"
) -> list[str]:
    """Status, stdout and stderr of a process of its own."""
    code = program.format(args)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    return [str(done.returncode), done.stdout, done.stderr]


def test_every_command_prints_its_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_status(["--version"]) in (None, 0)
    assert capsys.readouterr().out == f"sarsim {version('sarsim')}\n"


def test_quiet_prints_errors_alone() -> None:
    assert ended(["--count", "3", "--quiet"]) == ["0", "", ""]
    assert ended(["--count", "3", "--fail", "input", "--quiet"])[2] == "error: count 3 is too much\n"


def test_the_log_has_the_level_that_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    code = "import logging; from sarsim.commands.cli import *; run(lambda: logging.info('so'), {})"
    assert ended(["--log-level", "info"], code) == ["0", "", "INFO root: so\n"]
    assert ended([], code) == ["0", "", ""]
    assert exit_status(["--count", "3", "--log-level", "loud"]) == 2
    assert "--log-level" in capsys.readouterr().err


def test_progress_is_lines_without_a_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress_module, "LINE_INTERVAL", -1.0)
    with progress() as bars:
        bar = bars.add_task("steps", total=5)
        for _ in range(5):
            bars.advance(bar)
        assert list(bars.track([1, 2], description="scenes")) == [1, 2]
    lines = capsys.readouterr().err.splitlines()
    assert [line.partition(",")[0] for line in lines[:5]] == [f"steps: {k} of 5" for k in range(1, 6)]
    assert lines[-1].startswith("scenes: 2 of 2, ")


def test_progress_says_what_is_counted(capsys: pytest.CaptureFixture[str]) -> None:
    run_watched(lambda interrupted, show: show(Progress("arena: exploring, 6 m² mapped, step 11", 0.5)), "arena")
    assert list(tracked("ab", "letters")) == ["a", "b"]
    captured = capsys.readouterr()
    lines = [line.partition(", 0 s")[0] for line in captured.err.splitlines()]
    assert (lines, captured.out) == (["arena: exploring, 6 m² mapped, step 11", "letters: 2 of 2"], "")


def test_the_time_left_is_shown_where_a_clock_runs(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress_module, "LINE_INTERVAL", -1.0)
    with shown_run("arena") as show:
        show(Progress("first look"))
        show(Progress("mission", 0.25, is_timed=True))
        show(Progress("exploring", 0.5))
        show(Progress("writing"))
    first, mission, exploring, writing, _ = capsys.readouterr().err.splitlines()
    assert mission.startswith("mission, ") and mission.endswith(" left")
    assert not any("left" in line or " of " in line for line in (first, exploring, writing))


def test_progress_leaves_the_last_word_to_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InputError), progress() as bars:
        bars.update(bars.add_task("steps", total=5), advance=1)
        raise InputError("no more")
    assert capsys.readouterr().err == ""


COMPILING = """
import numba
from sarsim.commands.cli import announce_compilation

announce_compilation()
for function in (lambda x: x + 1, lambda x: x + 2):
    numba.njit(function)(1)
"""


@pytest.mark.compiles
def test_a_person_is_informed_once_that_numba_compiles() -> None:
    terminal, stderr = pty.openpty()
    assert subprocess.run([sys.executable, "-c", COMPILING], stderr=stderr).returncode == 0
    os.close(stderr)
    assert os.read(terminal, 10_000).count(b"compiling for this machine") == 1
    os.close(terminal)
    assert ended([], COMPILING)[2] == ""


NO_UTF8 = {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C"}


@pytest.mark.parametrize(
    ("code", "status", "said"),
    [
        ("run(lambda: print(chr(0xB0)), [])", 0, r"\xb0"),
        ("run(lambda out='': None, ['--out', os.fsdecode(bytes([122, 195, 188]))])", 2, "LC_ALL=C.UTF-8"),
    ],
)
def test_a_locale_without_utf8_gives_escapes_or_one_line(code: str, status: int, said: str) -> None:
    program = f"import os; from sarsim.commands.cli import run; {code}"
    done = subprocess.run(
        [sys.executable, "-c", program], env=os.environ | NO_UTF8, capture_output=True, text=True, check=False
    )
    assert done.returncode == status and said in done.stdout + done.stderr
    assert len((done.stdout + done.stderr).splitlines()) == 1
