"""Jobs in workers: nothing is lost, whichever process dies or is interrupted, and nothing is left at the end.

``KILLS`` in the environment says how often a command is interrupted; ``make endurance`` asks for more than the suite.
"""

import multiprocessing
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import pytest

from pipeline.errors import InputError
from sarsim import jobs
from sarsim.jobs import locked, make_engine, start_worker
from tests.source_tree import ROOT

KILLS = int(os.environ.get("KILLS", "1"))
LONG = 60.0  # s, of a job that is to be killed meanwhile, and of waiting for one
LARGE = 10_000_000  # bytes, of a result that does not fit into a pipe
DEADLINE = 5.0  # s, for everything to end after an interrupt


def write(job: int, folder: Path) -> str:
    """Write a file, in a folder of its own; its name."""
    path = folder / "made" / f"{job}.txt"
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"{job}\n")
    return path.name


def die_the_first_time(job: int, folder: Path) -> str:
    """Write a file, but die over the first attempt, halfway."""
    begun = folder / f"{job}.begun"
    if not begun.exists():
        begun.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return write(job, folder)


def die_at_0(job: int, folder: Path) -> str:
    """Write a file, but always die over job 0."""
    if job == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return write(job, folder)


def die_while_answering(job: int, folder: Path) -> bytes:
    """A large result; the first time, the worker dies when it has sent a part of it."""
    begun = folder / "begun"
    if not begun.exists():
        begun.touch()
        threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGKILL)).start()
    return bytes(LARGE)


def hold(job: tuple[int, Path], folder: Path) -> str:
    """Write a file once ``go`` is in the folder that is given with the job, where each attempt is noted."""
    number, begun = job
    with (begun / str(number)).open("a") as file:
        file.write("begun ")
    wait_for(begun / "go")
    return write(number, folder)


def wait_for(*paths: Path) -> None:
    """Wait until all of these files are there, for a minute at most."""
    end = time.monotonic() + LONG
    while not all(path.exists() for path in paths):
        assert time.monotonic() < end, paths
        time.sleep(0.01)


def fail(job: int, folder: Path) -> str:
    """Fail: by bad input, by an error that cannot be sent, or by an error of the program."""
    if job == 0:
        raise InputError("--bad: input")
    raise (Unsendable(folder, job) if job == 1 else KeyError("a bug"))


class Unsendable(Exception):  # noqa: N818 - a name of the test's own
    """An error that cannot be made again from its text."""

    def __init__(self, folder: Path, job: int):
        super().__init__(f"{folder.name} {job}")


def stay(job: int, folder: Path) -> str:
    """Stay halfway, and take some time to clean up."""
    try:
        (folder / f"{job}.begun").touch()
        time.sleep(LONG)
    finally:
        time.sleep(1)
        (folder / f"{job}.cleaned").touch()
    return ""


def refuse_to_end(job: int, folder: Path) -> str:
    """Stay halfway, whatever SIGTERM says."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    (folder / f"{job}.begun").touch()
    time.sleep(LONG)
    return ""


def threads(job: int, folder: Path) -> str:
    """The number of threads that numerical libraries may use."""
    return os.environ["OMP_NUM_THREADS"]


def outcomes(workers: int, do: Callable[[int, Path], Any], numbers: Iterable[int], folder: Path) -> dict[int, Any]:
    """What each job gave on this machine: its result or its error."""
    with locked(folder) as lock, closing(make_engine("local", workers)(do, numbers, lock)) as ended:
        found = {job: error or result for job, result, error in ended}
    assert multiprocessing.active_children() == []
    return found


def made(folder: Path) -> set[str]:
    """Names of the files that jobs have written."""
    return {path.name for path in folder.glob("made/*")}


@pytest.mark.parametrize(("workers", "count"), [(1, 3), (3, 5), (2, 0)])
def test_every_job_is_done_by_any_number_of_workers(tmp_path: Path, workers: int, count: int) -> None:
    assert outcomes(workers, write, range(count), tmp_path) == {job: f"{job}.txt" for job in range(count)}
    assert made(tmp_path) == {f"{job}.txt" for job in range(count)}


def test_a_worker_that_dies_costs_nothing_but_time(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert outcomes(2, die_the_first_time, range(3), tmp_path) == {job: f"{job}.txt" for job in range(3)}
    assert len(caplog.records) == 3


def test_a_job_over_which_every_worker_dies_is_given_up_and_no_other(tmp_path: Path) -> None:
    found = outcomes(2, die_at_0, range(6), tmp_path)
    error = found.pop(0)
    assert isinstance(error, InputError) and "-9" in str(error)
    assert found == {job: f"{job}.txt" for job in range(1, 6)}
    assert made(tmp_path) == set(found.values())


def test_a_worker_that_dies_in_the_middle_of_its_answer_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wait = jobs.wait

    def wait_late(pipes: list[Connection]) -> list[Any]:
        """Wait until the worker, which has filled the pipe, has died."""
        time.sleep(3.0)
        return wait(pipes)

    monkeypatch.setattr(jobs, "wait", wait_late)
    found = outcomes(1, die_while_answering, range(1), tmp_path)
    assert len(found[0]) == LARGE and (tmp_path / "begun").exists()


def test_a_worker_that_dies_between_two_jobs_is_replaced(tmp_path: Path) -> None:
    with locked(tmp_path) as lock, closing(make_engine("local", 1)(write, range(2), lock)) as ended:
        next(ended)
        (worker,) = multiprocessing.active_children()
        assert worker.pid is not None
        os.kill(worker.pid, signal.SIGKILL)
        os.waitid(os.P_PID, worker.pid, os.WEXITED | os.WNOWAIT)
        assert list(ended) == [(1, "1.txt", None)]


def check_failures(found: dict[int, Any], name: str) -> None:
    """Bad input is reported as it is, an error of the program with its place."""
    assert isinstance(found[0], InputError) and str(found[0]) == "--bad: input"
    assert isinstance(found[1], RuntimeError) and f"Unsendable: {name}" in str(found[1])
    assert isinstance(found[2], RuntimeError) and "test_jobs.py" in str(found[2]) and "a bug" in str(found[2])


def test_what_goes_wrong_in_a_job_is_reported(tmp_path: Path) -> None:
    check_failures(outcomes(2, fail, range(3), tmp_path), f"{tmp_path.name} 1")


def test_workers_use_one_thread_and_this_process_as_many_as_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    assert outcomes(1, threads, range(1), tmp_path) == {0: "1"}
    assert os.environ["OMP_NUM_THREADS"] == "7" and "NUMBA_NUM_THREADS" not in os.environ


@pytest.mark.parametrize(("do", "cleaned"), [(stay, 2), (refuse_to_end, 0)])
def test_an_interrupt_lets_workers_clean_up_and_ends_all_of_them_in_time(
    tmp_path: Path, do: Callable[[int, Path], str], cleaned: int
) -> None:
    pressed: list[float] = []

    def press() -> None:
        wait_for(*(tmp_path / f"{job}.begun" for job in range(2)))
        pressed.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    finger = threading.Thread(target=press)
    finger.start()
    with pytest.raises(KeyboardInterrupt):
        outcomes(2, do, range(2), tmp_path)
    finger.join()
    assert time.monotonic() < pressed[0] + DEADLINE
    assert multiprocessing.active_children() == []
    assert len(list(tmp_path.glob("*.cleaned"))) == cleaned


COMMAND = """
import sys
from contextlib import closing
from pathlib import Path
from sarsim.jobs import locked, make_engine
from tests.sarsim import test_jobs

if __name__ == "__main__":
    do = getattr(test_jobs, sys.argv[2])
    with locked(Path(sys.argv[1])) as lock, closing(make_engine("local", 2)(do, range(1000), lock)) as ended:
        for job in ended:
            pass
"""


def command(folder: Path, do: Callable[[int, Path], str]) -> subprocess.Popen[str]:
    """A command in a session of its own, which runs many jobs in a folder."""
    folder.mkdir()
    script = folder.parent / "command.py"
    script.write_text(COMMAND)
    return subprocess.Popen(
        [sys.executable, script, folder, do.__name__],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )


def alive(session: int) -> list[str]:
    """Names of the processes of a session that have not ended."""
    stats = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            stats.append(path.read_text())
        except OSError:  # It has ended meanwhile
            continue
    # After the command's name in brackets: state, parent, group, session.
    fields = {stat.split()[0]: stat.rpartition(") ")[2].split() for stat in stats}
    return [pid for pid, rest in fields.items() if rest[3] == str(session) and rest[0] != "Z"]


@pytest.mark.parametrize("attempt", range(KILLS))
@pytest.mark.parametrize(("ended_by", "patience"), [(signal.SIGINT, DEADLINE), (signal.SIGKILL, 4 * DEADLINE)])
def test_a_command_ended_at_any_moment_takes_its_workers_along(
    tmp_path: Path, ended_by: signal.Signals, patience: float, attempt: int
) -> None:
    moment = random.Random(attempt).uniform(0.0, 3.0)
    with command(tmp_path / "folder", die_the_first_time) as running:
        time.sleep(moment)
        # A terminal sends Ctrl-C to all processes of the group.
        (os.killpg if ended_by == signal.SIGINT else os.kill)(running.pid, ended_by)
        end = time.monotonic() + patience  # A worker without a parent first finishes its imports
        while alive(running.pid) and time.monotonic() < end:
            time.sleep(0.05)
        assert alive(running.pid) == [], f"after {moment} s"


def test_a_folder_is_free_only_when_the_workers_of_a_killed_command_have_ended(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    with command(folder, stay) as running:
        wait_for(folder / "0.begun", folder / "1.begun")
        running.kill()
    assert not (folder / "0.cleaned").exists()
    with locked(folder):
        assert (folder / "0.cleaned").exists() and (folder / "1.cleaned").exists()


def make_temporary_folder(pipe: Connection, folder: Path) -> None:
    """Use a temporary folder for a long time."""
    with tempfile.TemporaryDirectory(dir=folder):
        pipe.send("working")
        time.sleep(LONG)


def test_a_worker_that_is_terminated_cleans_up(tmp_path: Path) -> None:
    process, pipe = start_worker(make_temporary_folder, tmp_path)
    assert pipe.recv() == "working" and len(list(tmp_path.iterdir())) == 1
    process.terminate()
    process.join()
    assert not list(tmp_path.iterdir())


@pytest.fixture
def time_limit() -> Iterator[None]:
    """Let a test fail that waits for Ray without end."""
    handler = signal.signal(signal.SIGALRM, lambda *_: pytest.fail("takes more than 3 minutes"))
    signal.alarm(180)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, handler)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """A Ray cluster of one node, of one processor."""
    from ray.cluster_utils import Cluster  # Here, because workers import this module

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    yield cluster
    cluster.shutdown()


@pytest.mark.usefixtures("time_limit")
def test_what_goes_wrong_in_a_task_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    with locked(tmp_path) as lock, closing(make_engine("ray", 1)(fail, range(3), lock)) as ended:
        found = {job: error for job, _, error in ended}
    check_failures(found, "")


@pytest.mark.usefixtures("time_limit")
def test_a_cluster_that_loses_one_of_two_nodes_does_all_jobs(
    tmp_path: Path, cluster: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RAY_ADDRESS", cluster.address)
    node, begun, folder = cluster.add_node(num_cpus=1), tmp_path / "begun", tmp_path / "folder"
    begun.mkdir()
    folder.mkdir()

    def lose_the_node() -> None:
        wait_for(begun / "0", begun / "1")
        cluster.remove_node(node, allow_graceful=False)
        (begun / "go").touch()

    thief = threading.Thread(target=lose_the_node)
    todo = [(number, begun) for number in range(3)]
    with locked(folder) as lock, closing(make_engine("ray", 2)(hold, todo, lock)) as ended:
        thief.start()
        assert {job[0]: result for job, result, _ in ended} == {n: f"{n}.txt" for n in range(3)}
    thief.join()
    assert sorted((begun / f"{n}").read_text() for n in range(2)) == ["begun ", "begun begun "]
    assert made(folder) == {"0.txt", "1.txt", "2.txt"}


@pytest.mark.usefixtures("time_limit")
def test_a_dataset_made_by_ray_has_the_same_bytes(
    tmp_path: Path, cluster: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from sarsim.dataset.generate import generate
    from tests.sarsim.dataset.small import RECIPE, InProcess, files

    monkeypatch.setenv("RAY_ADDRESS", cluster.address)
    for name, engine in (("ray", make_engine("ray", 1)), ("here", InProcess())):
        generate(RECIPE, 1, tmp_path / name / "data", engine)
    assert files(tmp_path / "ray") == files(tmp_path / "here")


def test_ray_is_asked_for_where_it_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(InputError, match=r"Ray .*pip install 'sarsim\[ray\]'"):
        make_engine("ray")
