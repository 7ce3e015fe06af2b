"""The viewer's process: what it listens on, and how it ends."""

import socket
import subprocess
import sys
import time
import urllib.request
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
import rerun as rr
from rerun.blueprint.components import PlayState
from rerun.chunk import RrdReader

from pipeline.errors import InputError
from pipeline.rerun.recorder import Recorder
from pipeline.rerun.viewer import Viewer
from tests.recordings import read

ELSEWHERE = "127.0.0.2"
"""Another address of this machine: a server on every interface answers here, one on 127.0.0.1 does not."""

PLAY_STATE = "TimePanelBlueprint:play_state"


@pytest.fixture(scope="module")
def page():
    viewer = Viewer("web")
    yield viewer
    viewer.close()


def ports(viewer):
    """Of the page, and of the recording that it shows."""
    address = urlsplit(viewer.page_url)
    source = urlsplit(parse_qs(address.query)["url"][0])
    assert address.hostname == source.hostname == "127.0.0.1"
    return [address.port, source.port]


def test_the_page_is_served(page):
    with urllib.request.urlopen(page.page_url) as answer:
        assert answer.status == 200
        assert b"rerun" in answer.read().lower()
    assert page.was_opened


def test_the_page_is_as_dark_as_what_it_shows(page):
    assert parse_qs(urlsplit(page.page_url).query)["theme"] == ["dark"]
    with urllib.request.urlopen(page.page_url) as answer:
        assert b'query.get("theme")' in answer.read()


def test_the_page_may_ask_this_machine_alone(page):
    with urllib.request.urlopen(page.page_url) as answer:
        policy = answer.headers["Content-Security-Policy"]
    allowed = [word for word in policy.replace(";", " ").split() if word.startswith("http")]
    assert allowed == [f"http://127.0.0.1:{ports(page)[1]}"]
    assert policy.startswith("default-src 'self'") and "connect-src 'self'" in policy and "*" not in policy


def test_rerun_itself_sends_nothing(tmp_path, monkeypatch):
    """Rerun stores telemetry that it is about to send in the home folder."""
    monkeypatch.setenv("HOME", str(tmp_path))
    viewer = Viewer("web")
    viewer.close()
    assert not list(tmp_path.rglob("*analytics*"))


def test_only_this_machine_is_served(page):
    for port in ports(page):
        socket.create_connection(("127.0.0.1", port), timeout=5).close()
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection((ELSEWHERE, port), timeout=5)


def test_a_page_ends_with_the_process_that_served_it():
    script = "from pipeline.rerun.viewer import Viewer; print(Viewer('web').page_url)"
    lines = subprocess.check_output([sys.executable, "-c", script], text=True).split()
    port = urlsplit(lines[-1]).port
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port), timeout=5)


def test_a_page_ends_with_a_process_that_is_killed():
    script = "import time; from pipeline.rerun.viewer import Viewer; Viewer('web'); time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        address = urlsplit(server.stdout.readline().split()[-1])
        port = urlsplit(parse_qs(address.query)["url"][0]).port
        socket.create_connection(("127.0.0.1", port), timeout=5).close()
        server.kill()
    for _ in range(100):
        try:
            socket.create_connection(("127.0.0.1", port), timeout=5).close()
        except ConnectionRefusedError:
            return
        time.sleep(0.1)
    pytest.fail("Rerun still listens")


def test_the_file_is_whole_when_the_viewer_was_closed_meanwhile(tmp_path):
    viewer = Viewer("web")
    recorder = Recorder(tmp_path / "episode.rrd", viewer)
    recorder.log_message("INFO", "before")
    viewer.close()
    for _ in range(5):
        recorder.stream.log("world/points", rr.Points3D(np.zeros((100_000, 3))))
    recorder.log_message("INFO", "after")
    recorder.close()
    rows = read(tmp_path / "episode.rrd")
    assert [row["TextLog:text"] for row in rows["/log"]] == [["before"], ["after"]]
    assert len(rows["/world/points"]) == 5


def test_a_window_needs_a_display(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(InputError, match="DISPLAY"):
        Viewer("spawn")


def test_a_recording_opens_at_its_end_where_the_map_is_whole(page, tmp_path):
    path = tmp_path / "episode.rrd"
    recorder = Recorder(path, page)
    recorder.close()
    reader = RrdReader(path)
    chunks = [chunk.to_record_batch().to_pylist() for chunk in reader.stream(store=reader.blueprints()[0])]
    states = [row[PLAY_STATE] for rows in chunks for row in rows if PLAY_STATE in row]
    assert states == [[PlayState.Following.value]]
