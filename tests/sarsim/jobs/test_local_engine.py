"""Workers on this machine: nothing is lost, whichever process dies, and nothing is left at the end."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from pipeline.errors import InputError
from sarsim.jobs import local_engine
from sarsim.jobs.folder_lock import locked
from sarsim.jobs.local_engine import LocalEngine
from tests.sarsim.jobs import work
from tests.source_tree import ROOT


def outcomes(workers: int, do: Callable[[int, Path], str], jobs: range, folder: Path) -> dict[int, Any]:
    """What each job gave: its result or its error."""
    with locked(folder) as lock, closing(LocalEngine(workers).run(do, jobs, lock)) as ended:
        found = {job: outcome.exception() or outcome.result() for job, outcome in ended}
    assert multiprocessing.active_children() == []
    return found


def made(folder: Path) -> set[str]:
    return {path.name for path in folder.glob("made/*")}


@pytest.mark.parametrize(("workers", "jobs"), [(1, 3), (3, 5), (2, 0)])
def test_every_job_is_done_by_any_number_of_workers(tmp_path: Path, workers: int, jobs: int) -> None:
    assert outcomes(workers, work.write, range(jobs), tmp_path) == {job: f"{job}.txt" for job in range(jobs)}
    assert made(tmp_path) == {f"{job}.txt" for job in range(jobs)}


def test_a_worker_that_dies_costs_nothing_but_time(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert outcomes(2, work.die_the_first_time, range(3), tmp_path) == {job: f"{job}.txt" for job in range(3)}
    assert len(caplog.records) == 3


def test_a_job_over_which_every_worker_dies_is_given_up_and_no_other(tmp_path: Path) -> None:
    found = outcomes(2, work.die_at_0, range(6), tmp_path)
    error = found.pop(0)
    assert isinstance(error, InputError) and "-9" in str(error)
    assert found == {job: f"{job}.txt" for job in range(1, 6)}
    assert made(tmp_path) == set(found.values())


def test_a_worker_that_dies_between_two_jobs_is_replaced(tmp_path: Path) -> None:
    with locked(tmp_path) as lock, closing(LocalEngine(1).run(work.write, range(2), lock)) as found:
        next(found)
        (worker,) = multiprocessing.active_children()
        os.kill(worker.pid, signal.SIGKILL)
        os.waitid(os.P_PID, worker.pid, os.WEXITED | os.WNOWAIT)
        ((job, outcome),) = found
    assert (job, outcome.result()) == (1, "1.txt")


def test_bad_input_is_reported_as_it_is_and_an_error_of_the_program_with_its_place(tmp_path: Path) -> None:
    found = outcomes(2, work.fail, range(3), tmp_path)
    assert isinstance(found[0], InputError) and str(found[0]) == "--bad: input"
    assert isinstance(found[1], RuntimeError) and f"Unsendable: {tmp_path.name} 1" in str(found[1])
    assert isinstance(found[2], RuntimeError) and "work.py" in str(found[2]) and "a bug" in str(found[2])


def test_workers_use_one_thread_and_this_process_as_many_as_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    assert outcomes(1, work.threads, range(1), tmp_path) == {0: "1"}
    assert os.environ["OMP_NUM_THREADS"] == "7" and "NUMBA_NUM_THREADS" not in os.environ


def interrupted(do: Callable[[int, Path], str], jobs: int, folder: Path) -> None:
    """Press Ctrl-C once all of some jobs have begun."""

    def press() -> None:
        work.wait_for(*(folder / f"{job}.begun" for job in range(jobs)))
        os.kill(os.getpid(), signal.SIGINT)

    finger = threading.Thread(target=press)
    finger.start()
    with pytest.raises(KeyboardInterrupt):
        outcomes(jobs, do, range(jobs), folder)
    finger.join()
    assert multiprocessing.active_children() == []


def test_an_interrupt_lets_every_worker_clean_up(tmp_path: Path) -> None:
    interrupted(work.stay, 2, tmp_path)
    assert {path.name for path in tmp_path.glob("*.cleaned")} == {"0.cleaned", "1.cleaned"}


def test_a_worker_that_does_not_end_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_engine, "CLEANING", 0.1)
    interrupted(work.refuse_to_end, 1, tmp_path)


COMMAND = """
import sys
from pathlib import Path
from sarsim.jobs.folder_lock import locked
from sarsim.jobs.local_engine import LocalEngine
from tests.sarsim.jobs import work

if __name__ == "__main__":
    with locked(Path(sys.argv[1])) as lock:
        list(LocalEngine(1).run(work.stay, range(1), lock))
"""


def test_a_folder_is_free_only_when_the_workers_of_a_killed_command_have_ended(tmp_path: Path) -> None:
    script, folder = tmp_path / "command.py", tmp_path / "folder"
    script.write_text(COMMAND)
    folder.mkdir()
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen([sys.executable, script, folder], env=environment, stderr=subprocess.DEVNULL) as command:
        work.wait_for(folder / "0.begun")
        command.kill()
    assert not (folder / "0.cleaned").exists()
    with locked(folder):
        assert (folder / "0.cleaned").exists()
