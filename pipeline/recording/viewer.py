"""Rerun's viewer, in a process of its own that listens on this machine alone."""

import atexit
import os
import socket
import subprocess
import time
from importlib.resources import files
from pathlib import Path
from typing import Literal
from urllib.parse import quote

import rerun as rr

from pipeline.errors import InputError

ViewerKind = Literal["spawn", "web"]
"""A window of its own, or a page for the browser."""

HOST = "127.0.0.1"  # Rerun's own default is every interface of the machine
STARTING_TIME = 30.0
"""s, that a viewer may take until it listens."""


class Viewer:
    """A running viewer; a window stays open when this process ends, a page is served no longer.

    Attributes:
        page: where the browser finds a ``web`` viewer, otherwise None.
    """

    def __init__(self, kind: ViewerKind, *recordings: Path):
        """Start a viewer that shows recordings and what is logged to its sink; a page's address is printed.

        Raises:
            InputError: there is no display for a window, or the viewer does not start.
        """
        if kind == "spawn" and not has_display():
            raise InputError(
                "there is no display for the viewer's window (neither DISPLAY nor WAYLAND_DISPLAY is set)"
            )
        self._port = _free_port()
        self.page: str | None = None
        self._process = self._start(kind, recordings)
        self._await_port()
        if self.page:
            print(f"shown at {self.page}", flush=True)

    @property
    def sink(self) -> rr.GrpcSink:
        """Where a recording flows to be shown."""
        return rr.GrpcSink(self._address)

    def wait(self) -> None:
        """Until the viewer ends: its window is closed, or Ctrl-C is pressed where a page is served."""
        try:
            self._process.wait()
        except KeyboardInterrupt:
            self.close()

    def close(self) -> None:
        """End the viewer."""
        self._process.terminate()
        self._process.wait()

    @property
    def _address(self) -> str:
        return f"rerun+http://{HOST}:{self._port}/proxy"

    def _start(self, kind: ViewerKind, recordings: tuple[Path, ...]) -> subprocess.Popen[bytes]:
        flags = ["--bind", HOST, "--port", str(self._port)]
        if kind == "web":
            page_port = _free_port()
            self.page = f"http://{HOST}:{page_port}?url={quote(self._address, safe='')}"
            flags += ["--serve-web", "--web-viewer-port", str(page_port)]
        else:
            flags += ["--hide-welcome-screen"]
        # In a session of its own, Ctrl-C in the terminal does not reach it.
        process = subprocess.Popen(
            [executable(), *flags, *recordings],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        if kind == "web":
            atexit.register(process.terminate)
        return process

    def _await_port(self) -> None:
        deadline = time.monotonic() + STARTING_TIME
        while time.monotonic() < deadline and self._process.poll() is None:
            try:
                socket.create_connection((HOST, self._port), timeout=1).close()
                return
            except OSError:
                time.sleep(0.05)
        self.close()
        raise InputError(f"the Rerun viewer did not start (status {self._process.returncode})")


def has_display() -> bool:
    """Whether a window could open."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def executable() -> Path:
    """The viewer that came with the Python package, of the same version."""
    return Path(str(files("rerun_cli") / "rerun"))


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])
