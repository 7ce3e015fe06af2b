"""An engine with workers on a Ray cluster; sarsim must be installed on its machines."""

import os
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pipeline.errors import InputError
from pipeline.files import whole_file
from sarsim.dataset.engine import ATTEMPTS, Event, JobDone, JobFailed, Make, Product
from sarsim.dataset.folder_lock import FolderLock
from sarsim.dataset.processes import ONE_THREAD


class RayEngine:
    """Does jobs as Ray tasks and fetches their files; Ray itself restarts a task whose worker dies."""

    def __init__(self, workers: int, address: str | None = None):
        """Run at most ``workers`` tasks at a time, on the cluster at ``address`` or on one that is started here.

        Raises:
            InputError: Ray is not installed, or there is no cluster at the address.
        """
        self._count = workers
        try:
            import ray
        except ImportError as error:
            raise InputError("--engine ray: Ray is not installed: pip install 'sarsim[ray]'") from error
        self._ray: Any = ray
        own = {"num_cpus": workers, "include_dashboard": False, "_node_ip_address": "127.0.0.1"}
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        try:
            options = own if address is None else {"address": address}
            ray.init(log_to_driver=False, runtime_env={"env_vars": ONE_THREAD}, **options)
        except ConnectionError as error:
            raise InputError(f"RAY_ADDRESS {address}: no Ray cluster there") from error

    def run(self, make: Make, indices: Sequence[int], folder: Path, lock: FolderLock) -> Iterator[Event]:
        """See :class:`sarsim.dataset.engine.Engine`; only this process writes into the folder."""
        task = self._ray.remote(num_cpus=1, max_retries=ATTEMPTS - 1)(_make)
        todo, shared = list(indices), self._ray.put(make)
        running: dict[Any, int] = {}
        try:
            while todo or running:
                while todo and len(running) < self._count:
                    index = todo.pop(0)
                    running[task.remote(shared, index)] = index
                (done,), _ = self._ray.wait(list(running))
                yield self._event(done, running.pop(done), folder)
        finally:
            self._ray.shutdown()

    def _event(self, done: Any, index: int, folder: Path) -> Event:
        """Write the file of a finished job; how it ended."""
        try:
            product, content = self._ray.get(done)
        except self._ray.exceptions.RayTaskError as error:
            return JobFailed(index, error.cause)
        except self._ray.exceptions.RayError as error:
            return JobFailed(index, InputError(f"a Ray worker failed: {' '.join(str(error).split())}"))
        path = folder / product.file
        path.parent.mkdir(exist_ok=True)
        with whole_file(path) as partial:
            partial.write_bytes(content)
        return JobDone(product)


def _make(make: Make, index: int) -> tuple[Product, bytes]:
    """Do a job; returns its product and the bytes of its file, which the task's machine does not keep."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        product = make(index, folder, lambda: None)
        return product, (folder / product.file).read_bytes()
