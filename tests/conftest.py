"""What holds for every test."""

import gc
import os
import signal
import sys
from pathlib import Path

import pytest
from filelock import FileLock
from hypothesis import settings

from sarsim.startup import prepare_process

# Tests run in as many processes as there are cores, so each process is to use one. Set before anything reads it.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(name, "1")
os.environ.setdefault("LP_NUM_THREADS", "0")  # Mesa's software renderer: in the thread that draws

# As commands do, which tests call in this process.
prepare_process()

# A shell that starts the tests in the background has them ignore Ctrl-C, and so the commands that they interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Compiled functions are slow the first time, and a failure must come back when the tests are run again.
settings.register_profile("sarsim", deadline=None, derandomize=True)
settings.load_profile("sarsim")


def pytest_configure() -> None:
    """Let no episode in this process start another one that compiles: tests keep every core busy."""
    from sarsim import compilation

    compilation.compile_on_two_cores = lambda: None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with whole episodes: one process runs them all, and short tests are left to share out at the end."""
    items.sort(key=lambda item: item.path.name != "test_run_episode.py")


def pytest_collection_finish() -> None:
    """Keep what was imported out of every later garbage collection, which need not look through it."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def episode(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a whole episode in the NIST arena with true labels, one for all processes that run tests.

    Tests read it and leave it as it is.
    """
    from sarsim.commands.settings import save_settings
    from sarsim.episode import Episode
    from sarsim.settings import EpisodeConfig

    base = tmp_path_factory.getbasetemp()
    out = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "episode"
    with FileLock(f"{out}.lock"):
        if not out.exists():
            config = EpisodeConfig(labels="truth", detector=None, out=out)
            assert Episode(config).run()
            save_settings(config, out / "config.yaml")
    return out


@pytest.fixture
def unisolated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Check files in this process: a new one for each takes a second, and that is tested elsewhere."""
    for name in ("sarsim.vetting.trial", "pipeline.victims.opencv_network"):
        if name in sys.modules:
            monkeypatch.setattr(f"{name}.run_isolated", lambda function, *args, **limits: function(*args))


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder beside the checkout with arenas, a checkpoint and programs that are no part of the project."""
    path = Path(__file__).parents[2] / "shared"
    if not path.is_dir():
        pytest.skip("no folder `shared` beside the checkout")
    return path
