"""Kill the dataset generator at random moments, fill its disk, and see that nothing is lost: ``check_generator.py``.

It is started again each time; in the end its files must be, byte for byte, those of a run that nobody disturbed.
"""

import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.progress import track

from sarsim.dataset.manifest import FILE, sha256_of
from sarsim.scripts import generate_dataset
from sarsim.scripts.cli import BAD_INPUT, run

WORKERS_KILLED = 2
"""In one run at most: a scene over which a third one dies is given up."""


@dataclass(frozen=True)
class CheckConfig:
    """What is generated, and how often it is killed.

    Attributes:
        kills: SIGKILL so often: to a worker, to the command alone, or to all of its processes at once.
        scenes: of the dataset.
        frames: looks a scene.
        workers: processes at a time.
        seed: of the moments and of the dataset.
    """

    kills: int = 10
    scenes: int = 6
    frames: int = 20
    workers: int = 2
    seed: int = 0

    def command(self, folder: Path) -> list[str]:
        """What makes the dataset."""
        flags = {"out": folder, "scenes": self.scenes, "frames": self.frames, "workers": self.workers}
        flags |= {"seed": self.seed, "width": 160, "height": 120}
        words = [word for name, value in flags.items() for word in (f"--{name}", str(value))]
        return [sys.executable, generate_dataset.__file__, *words]


def check_generator(config: Annotated[CheckConfig, tyro.conf.arg(name="")]) -> None:
    """Compare a disturbed run with an undisturbed one; the exit status is 1 if they differ."""
    with tempfile.TemporaryDirectory() as name:
        whole, folder = (Path(name, kind, "dataset") for kind in ("undisturbed", "disturbed"))
        start = time.perf_counter()
        Run(config.command(whole)).finish()
        expected = checksums(whole)
        killer = Killer(config.command(folder), folder, expected, time.perf_counter() - start, config.seed)
        for _ in track(range(config.kills), "kills", console=Console(stderr=True)):
            killer.kill()
        killer.end()
        told = fill_disk(config.command(folder), folder, expected)
        Run(config.command(folder)).finish()
        check_same(folder, expected)
    Console().print(f"full disk: {told}", soft_wrap=True, highlight=False)
    Console().print(f"killed: {', '.join(killer.victims)}; the same {len(expected)} files as undisturbed")


def check(condition: bool, broken: str) -> None:
    """End with status 1 if a promise is broken."""
    if not condition:
        sys.exit(f"broken promise: {broken}")


def checksums(folder: Path) -> dict[str, str]:
    """SHA-256 of every file by its path."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): sha256_of(path) for path in files}


def check_same(folder: Path, expected: dict[str, str]) -> None:
    """It holds just what an undisturbed run makes."""
    differing = {path for path, _ in checksums(folder).items() ^ expected.items()}
    check(not differing, f"unlike an undisturbed run: {', '.join(sorted(differing))}")


def check_whole(folder: Path, expected: dict[str, str]) -> None:
    """Every scene that is there under its name is whole; what is being written has another one."""
    for path, digest in checksums(folder).items():
        if path.endswith(".h5"):
            check(digest == expected[path], f"{path} is not whole")


class Run:
    """A command that runs, with all the processes that it starts."""

    def __init__(self, command: list[str], prepare: Callable[[], object] | None = None):
        """``prepare`` is called in its process before it."""
        self.process = subprocess.Popen(
            command,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=prepare,
        )

    @property
    def children(self) -> list[int]:
        """Ids of the other processes of its session."""
        stats = [path.read_text() for path in Path("/proc").glob("[0-9]*/stat") if path.exists()]
        # After the command's name in brackets: state, parent, group, session.
        fields = [(int(stat.split()[0]), stat.rsplit(")", 1)[1].split()) for stat in stats]
        session = str(self.process.pid)
        return [pid for pid, rest in fields if rest[3] == session and rest[0] != "Z" and str(pid) != session]

    def wait(self) -> str:
        """What it said on stderr, without the progress bar, when it has ended."""
        _, errors = self.process.communicate()
        return "\n".join(line for line in errors.splitlines() if not line.startswith("frames"))

    def finish(self) -> None:
        """Wait until it is done."""
        said = self.wait()
        check(self.process.returncode == 0, f"exit status {self.process.returncode}: {said}")


class Killer:
    """Starts a generator and kills something of it, again and again.

    Attributes:
        victims: what was killed.
    """

    def __init__(self, command: list[str], folder: Path, expected: dict[str, str], seconds: float, seed: int):
        """``seconds`` that an undisturbed run takes."""
        self._command, self._folder, self._expected, self._seconds = command, folder, expected, seconds
        self._rng = np.random.default_rng(seed)
        self._run = Run(command)
        self._workers = 0
        self.victims: list[str] = []

    def kill(self) -> None:
        """Wait for a random moment and kill something; a run that ends before is checked and begun anew."""
        try:
            self._run.process.wait(self._rng.uniform(0, self._seconds))
        except subprocess.TimeoutExpired:
            self._strike()
        else:
            self._run.finish()
            check_same(self._folder, self._expected)
            shutil.rmtree(self._folder)
            self._begin()
            self.kill()

    def end(self) -> None:
        """Kill all."""
        os.killpg(self._run.process.pid, signal.SIGKILL)
        self._run.wait()

    def _strike(self) -> None:
        children = self._run.children
        kinds = ["command", "everything"] + ["worker"] * (bool(children) and self._workers < WORKERS_KILLED)
        victim = self._rng.choice(kinds)
        self.victims.append(str(victim))
        if victim == "worker":
            self._workers += 1
            os.kill(int(self._rng.choice(children)), signal.SIGKILL)
            return
        (os.kill if victim == "command" else os.killpg)(self._run.process.pid, signal.SIGKILL)
        self._run.wait()
        check_whole(self._folder, self._expected)
        self._begin()

    def _begin(self) -> None:
        self._run, self._workers = Run(self._command), 0


def fill_disk(command: list[str], folder: Path, expected: dict[str, str]) -> str:
    """Let no file grow to the size of a scene's; returns what the generator says of that."""
    for scene in folder.glob("scenes/*.h5"):
        scene.unlink()
    manifest = folder / FILE  # not there yet if every run was killed right at its start
    size = max(manifest.stat().st_size if manifest.exists() else 0, 1 << 16)
    full = Run(command, lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)))
    said = full.wait()
    check(full.process.returncode == BAD_INPUT, f"full disk: exit status {full.process.returncode}: {said}")
    check_whole(folder, expected)
    check(not list(folder.rglob("*.part")), "a full disk leaves half-written files")
    return said


def main() -> None:
    """Entry point."""
    run(check_generator)


if __name__ == "__main__":
    main()
