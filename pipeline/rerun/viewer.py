"""Rerun's viewer, in a separate process that only this machine can reach."""

import atexit
import os
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from email.message import Message
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import Path
from subprocess import DEVNULL, Popen
from threading import Thread
from typing import Literal
from urllib.error import HTTPError
from urllib.parse import quote
from urllib.request import Request, urlopen

import rerun as rr

from pipeline.errors import InputError
from pipeline.processes import end_with_parent

ViewerKind = Literal["spawn", "web"]  # A separate window, or a page for a browser

HOST = "127.0.0.1"  # By default, Rerun listens on every interface of the machine
CONTENT_SECURITY_POLICY = "default-src 'self' data: blob: 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval'"
"""Content security policy: the page may load only from its own server."""
DROPPED_HEADERS = ("connection", "content-length", "date", "server", "transfer-encoding", "content-security-policy")
"""Headers that the proxy does not forward."""
START_TIMEOUT = 30.0
"""Maximum time until a viewer accepts connections, s."""


class Viewer:
    """A running viewer; when this process ends, a window stays open, but a page is no longer served.

    Attributes:
        page_url: address of a ``web`` viewer; None for a window.
    """

    def __init__(self, kind: ViewerKind, *recordings: Path):
        """Start a viewer of recordings and of data logged to the viewer's sink; print the address of a page.

        Args:
            kind: window or page.
            recordings: recordings to show.

        Raises:
            InputError: there is no display for a window, or the viewer does not start.
        """
        if kind == "spawn" and not has_display():
            raise InputError("the viewer's window needs a display; set DISPLAY or WAYLAND_DISPLAY, or use --view web")
        self._port = _free_port()
        self._address = f"rerun+http://{HOST}:{self._port}/proxy"
        self.page_url: str | None = None
        self._proxy: PageProxy | None = None
        self._process = self._start(kind, recordings)
        self._await_port()
        if self.page_url:
            print(f"Open in a browser: {self.page_url}", flush=True)

    @property
    def was_opened(self) -> bool:
        """Whether somebody has opened the page."""
        return self._proxy is not None and self._proxy.was_opened

    @property
    def sink(self) -> rr.GrpcSink:
        """The sink that streams a recording to the viewer."""
        return rr.GrpcSink(self._address)

    def wait(self) -> None:
        """Block until the viewer ends, for example because its window is closed; Ctrl-C ends the viewer."""
        try:
            self._process.wait()
        except KeyboardInterrupt:
            self.close()

    def close(self) -> None:
        """End the viewer."""
        self._process.terminate()
        self._process.wait()
        if self._proxy:
            self._proxy.shutdown()
            self._proxy.server_close()

    def _start(self, kind: ViewerKind, recordings: tuple[Path, ...]) -> Popen[bytes]:
        flags = ["--bind", HOST, "--port", str(self._port)]
        if kind == "web":
            rerun_port = _free_port()
            self._proxy = PageProxy(f"http://{HOST}:{rerun_port}", f"http://{HOST}:{self._port}")
            self.page_url = f"http://{HOST}:{self._proxy.server_port}?theme=dark&url={quote(self._address, safe='')}"
            flags += ["--serve-web", "--web-viewer-port", str(rerun_port)]
        else:
            flags += ["--hide-welcome-screen"]
        process = start_rerun(*flags, *recordings, preexec=end_with_parent if kind == "web" else None)
        if kind == "web":
            atexit.register(process.terminate)
        return process

    def _await_port(self) -> None:
        deadline = time.monotonic() + START_TIMEOUT
        while time.monotonic() < deadline and self._process.poll() is None:
            try:
                socket.create_connection((HOST, self._port), timeout=1).close()
                if self._proxy:
                    urlopen(self._proxy.rerun, timeout=1).close()
                return
            except OSError:
                time.sleep(0.05)
        status = self._process.poll()
        self.close()
        what = (
            f"did not respond within {START_TIMEOUT:g} s"
            if status is None
            else f"failed to start: exit status {status}"
        )
        raise InputError(f"the Rerun viewer {what}")


class PageProxy(ThreadingHTTPServer):
    """A proxy for Rerun's page, with a policy that allows requests only to this machine.

    Without the policy, the page sends telemetry, requests fonts and examples, and checks for updates (Rerun 0.41).
    The proxy ends with this process.

    Attributes:
        rerun: address of Rerun's own page.
        was_opened: whether the server has received a request.
        policy: content security policy that is sent with the page.
    """

    daemon_threads = True

    def __init__(self, rerun: str, recording: str) -> None:
        """Serve Rerun's page from the address ``rerun``; the page may also read from the address ``recording``."""
        self.rerun, self.was_opened = rerun, False
        self.policy = f"{CONTENT_SECURITY_POLICY}; connect-src 'self' data: blob: {recording}"
        super().__init__((HOST, 0), _ForwardingHandler)
        Thread(target=self.serve_forever, daemon=True).start()


class _ForwardingHandler(BaseHTTPRequestHandler):
    server: PageProxy

    def do_GET(self) -> None:
        """Forward Rerun's response, but with this server's content security policy."""
        self.server.was_opened = True
        passed = {name: self.headers[name] for name in ("Accept-Encoding",) if name in self.headers}
        try:
            with urlopen(Request(self.server.rerun + self.path, headers=passed)) as answer:
                status, headers, content = answer.status, answer.headers, answer.read()
        except HTTPError as error:
            status, headers, content = error.code, error.headers, error.read()
        except OSError:
            status, headers, content = HTTPStatus.BAD_GATEWAY, Message(), b"the viewer is no longer running"
        self.send_response(status)
        for name, value in headers.items():
            if name.lower() not in DROPPED_HEADERS:
                self.send_header(name, value)
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Content-Security-Policy", self.server.policy)
        self.end_headers()
        with suppress(OSError):  # the browser was closed
            self.wfile.write(content)

    def log_message(self, *_: object) -> None:
        """Print nothing."""


def has_display() -> bool:
    """Whether there is a display for a window."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def start_rerun(*arguments: str | Path, preexec: Callable[[], None] | None = None) -> Popen[bytes]:
    """Start the Rerun program of the Python package, which Ctrl-C does not reach.

    ``preexec`` is called in the new process before the program starts. The program sends no telemetry, as in
    continuous integration, and the user's own settings for Rerun stay unchanged.
    """
    command, quiet = [str(files("rerun_cli") / "rerun"), *arguments], os.environ | {"CI": "1"}
    return Popen(
        command, env=quiet, stdin=DEVNULL, stdout=DEVNULL, stderr=DEVNULL, start_new_session=True, preexec_fn=preexec
    )


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])
