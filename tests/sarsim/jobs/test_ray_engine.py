"""Jobs done by Ray's tasks: nothing is lost with a node, and scenes have the same bytes as in this process."""

import signal
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from ray.cluster_utils import Cluster

from pipeline.errors import InputError
from sarsim.dataset.generate import generate
from sarsim.jobs.folder_lock import locked
from sarsim.jobs.ray_engine import RayEngine
from tests.sarsim.dataset.small import RECIPE, InProcess, files
from tests.sarsim.jobs import work


@pytest.fixture(autouse=True)
def time_limit() -> Iterator[None]:
    """Let a test fail that waits for Ray without end."""
    handler = signal.signal(signal.SIGALRM, lambda *_: pytest.fail("takes more than 3 minutes"))
    signal.alarm(180)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, handler)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    """A cluster of one node, of one processor."""
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    yield cluster
    cluster.shutdown()


def test_what_goes_wrong_in_a_task_is_reported(tmp_path: Path) -> None:
    with locked(tmp_path) as lock, closing(RayEngine(1).run(work.fail, range(3), lock)) as ended:
        found = {job: outcome.exception() for job, outcome in ended}
    assert isinstance(found[0], InputError) and str(found[0]) == "--bad: input"
    assert "Unsendable" in str(found[1]) and "a bug" in str(found[2])


def test_a_cluster_that_loses_one_of_two_nodes_does_all_jobs(tmp_path: Path, cluster: Cluster) -> None:
    node, begun, folder = cluster.add_node(num_cpus=1), tmp_path / "begun", tmp_path / "folder"
    begun.mkdir()
    folder.mkdir()

    def lose_the_node() -> None:
        work.wait_for(begun / "0", begun / "1")
        cluster.remove_node(node, allow_graceful=False)
        (begun / "go").touch()

    thief = threading.Thread(target=lose_the_node)
    jobs = [(number, begun) for number in range(3)]
    with locked(folder) as lock, closing(RayEngine(2, cluster.address).run(work.hold, jobs, lock)) as ended:
        thief.start()
        assert {job[0]: outcome.result() for job, outcome in ended} == {n: f"{n}.txt" for n in range(3)}
    thief.join()
    assert sorted((begun / f"{n}").read_text() for n in range(2)) == ["begun ", "begun begun "]
    assert {path.name for path in folder.glob("made/*")} == {"0.txt", "1.txt", "2.txt"}


def test_a_dataset_has_the_same_bytes(tmp_path: Path, cluster: Cluster) -> None:
    for name, engine in (("ray", RayEngine(1, cluster.address)), ("here", InProcess())):
        generate(RECIPE, 1, tmp_path / name / "data", engine)
    assert files(tmp_path / "ray") == files(tmp_path / "here")
