"""Rerun's viewer, in a process of its own that listens on this machine alone."""

import atexit
import os
import socket
import time
from importlib.resources import files
from pathlib import Path
from subprocess import DEVNULL, Popen
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
        self._address = f"rerun+http://{HOST}:{self._port}/proxy"
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
        """Block until the window is closed or, where a page is served, Ctrl-C is pressed."""
        try:
            self._process.wait()
        except KeyboardInterrupt:
            self.close()

    def close(self) -> None:
        """End the viewer."""
        self._process.terminate()
        self._process.wait()

    def _start(self, kind: ViewerKind, recordings: tuple[Path, ...]) -> Popen[bytes]:
        flags = ["--bind", HOST, "--port", str(self._port)]
        if kind == "web":
            page_port = _free_port()
            self.page = f"http://{HOST}:{page_port}?url={quote(self._address, safe='')}"
            flags += ["--serve-web", "--web-viewer-port", str(page_port)]
        else:
            flags += ["--hide-welcome-screen"]
        process = start_rerun(*flags, *recordings)
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


def start_rerun(*arguments: str | Path) -> Popen[bytes]:
    """Start Rerun's program of the Python package's version; Ctrl-C in the terminal does not reach it."""
    command = [str(files("rerun_cli") / "rerun"), *arguments]
    return Popen(command, stdin=DEVNULL, stdout=DEVNULL, stderr=DEVNULL, start_new_session=True)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])
