"""An engine with workers on a Ray cluster; sarsim must be installed on its machines."""

import os
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pipeline.errors import InputError
from pipeline.files import whole_file
from sarsim.dataset.engine import ATTEMPTS, Event, FrameDone, SceneDone
from sarsim.dataset.folder_lock import FolderLock
from sarsim.dataset.manifest import SCENES, SceneEntry
from sarsim.dataset.processes import ONE_THREAD
from sarsim.dataset.recipe import Recipe
from sarsim.dataset.render import make_scene


class RayEngine:
    """Makes scenes as Ray tasks and fetches their files; Ray itself restarts a task whose worker dies."""

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

    def render(self, recipe: Recipe, indices: Sequence[int], folder: Path, lock: FolderLock) -> Iterator[Event]:
        """See :class:`sarsim.dataset.engine.Engine`; only this process writes into the folder."""
        task = self._ray.remote(num_cpus=1, max_retries=ATTEMPTS - 1)(_make)
        todo = list(indices)
        running: list[Any] = []
        try:
            while todo or running:
                while todo and len(running) < self._count:
                    running.append(task.remote(recipe, todo.pop(0)))
                (done,), running = self._ray.wait(running)
                entry = self._store(done, folder)
                yield from [FrameDone(entry.index)] * entry.frames
                yield SceneDone(entry)
        finally:
            self._ray.shutdown()

    def _store(self, done: Any, folder: Path) -> SceneEntry:
        """Write the file of a finished scene."""
        try:
            entry, content = self._ray.get(done)
        except self._ray.exceptions.RayTaskError as error:
            raise error.cause from None
        except self._ray.exceptions.RayError as error:
            raise InputError(f"a Ray worker failed: {' '.join(str(error).split())}") from error
        with whole_file(folder / entry.file) as partial:
            partial.write_bytes(content)
        return entry


def _make(recipe: Recipe, index: int) -> tuple[SceneEntry, bytes]:
    """Make a scene; returns its entry and the bytes of its file, which the task's machine does not keep."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / SCENES).mkdir()
        entry = make_scene(recipe, index, folder)
        return entry, (folder / entry.file).read_bytes()
