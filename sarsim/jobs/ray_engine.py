"""An engine with workers on a Ray cluster; sarsim must be installed on all of its machines."""

import os
import tempfile
from collections import deque
from collections.abc import Iterable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from pipeline.errors import InputError
from pipeline.files import atomic_write
from sarsim.jobs.engine import ATTEMPTS, Job, Outcomes, Result, Work, done, failed
from sarsim.jobs.folder_lock import FolderLock
from sarsim.jobs.processes import ONE_THREAD


class RayEngine:
    """Runs jobs as Ray tasks and fetches their files; Ray itself restarts a task whose worker dies.

    Ray's pools use actors instead, and wait forever for an actor whose node is lost if no other node has room for it.
    """

    def __init__(self, workers: int, address: str | None = None):
        """Run at most ``workers`` tasks at a time, on the cluster at ``address`` or on a new local one.

        Raises:
            InputError: Ray is not installed, or there is no cluster at ``address``.
        """
        self._count = workers
        try:
            import ray
        except ImportError as error:
            raise InputError("--engine ray: Ray is not installed; run: pip install 'sarsim[ray]'") from error
        self._ray: Any = ray
        own = {"num_cpus": workers, "include_dashboard": False, "_node_ip_address": "127.0.0.1"}
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        try:
            options = own if address is None else {"address": address}
            ray.init(log_to_driver=False, runtime_env={"env_vars": ONE_THREAD}, **options)
        except ConnectionError as error:
            raise InputError(
                f"RAY_ADDRESS={address}: found no Ray cluster; correct the address, or unset it to use this machine"
            ) from error

    def run(self, work: Work[Job, Result], jobs: Iterable[Job], lock: FolderLock) -> Outcomes[Job, Result]:
        """See :class:`sarsim.jobs.engine.Engine`. Only this process writes into the folder."""
        task = self._ray.remote(num_cpus=1, max_retries=ATTEMPTS - 1)(_do)
        todo, shared = deque(jobs), self._ray.put(work)
        running: dict[Any, Job] = {}
        try:
            while todo or running:
                while todo and len(running) < self._count:
                    job = todo.popleft()
                    running[task.remote(shared, job)] = job
                (ended,), _ = self._ray.wait(list(running))
                yield running.pop(ended), self._outcome(ended, lock.folder)
        finally:
            self._ray.shutdown()

    def _outcome(self, ended: Any, folder: Path) -> Future[Any]:
        """The outcome of a task; its files are written into the folder."""
        outcome: Future[Any] = Future()
        try:
            result, files = self._ray.get(ended)
        except self._ray.exceptions.RayTaskError as error:
            outcome.set_exception(error.cause)
            return outcome
        except self._ray.exceptions.RayError as error:
            return failed(f"a Ray worker failed: {' '.join(str(error).split())}")
        for name, content in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            with atomic_write(folder / name) as part:
                part.write_bytes(content)
        outcome.set_result(result)
        return outcome


def _do(work: Work[Job, Result], job: Job) -> tuple[Result, dict[Path, bytes]]:
    """Do a job and return its result and the contents of its files, which are not kept on the task's machine."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        result = done(work, job, folder)
        files = [path for path in folder.rglob("*") if path.is_file()]
        return result, {path.relative_to(folder): path.read_bytes() for path in files}
