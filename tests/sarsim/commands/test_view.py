"""The view command: the files that it opens, and its messages about those that it cannot open."""

import os
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from pipeline.rerun.recorder import Recorder
from sarsim.commands.cli import TERMINATION_SIGNALS
from sarsim.commands.view import find_recording, leave

VIEW = Path(__file__).parents[3] / "scripts" / "view.py"
NO_DISPLAY = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}


@pytest.fixture(scope="module")
def episode(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("episode")
    recorder = Recorder(folder / "episode.rrd")
    recorder.log_message("INFO", "hello")
    recorder.close()
    return folder


def test_a_file_or_its_folder_names_the_recording(episode):
    assert find_recording(episode) == find_recording(episode / "episode.rrd") == episode / "episode.rrd"


def test_without_a_display_a_page_is_served_until_the_command_ends(episode):
    process = subprocess.Popen([sys.executable, VIEW, episode], env=NO_DISPLAY, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    page = process.stdout.readline().split()[-1]
    try:
        with urllib.request.urlopen(page) as answer:
            assert answer.status == 200
    finally:
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=20) == 0
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(page)


def test_a_second_signal_does_not_interrupt_the_end() -> None:
    before = {ending: signal.getsignal(ending) for ending in TERMINATION_SIGNALS}
    try:
        with pytest.raises(SystemExit):
            leave(signal.SIGTERM)
        assert all(signal.getsignal(ending) == signal.SIG_IGN for ending in TERMINATION_SIGNALS)
    finally:
        for ending, handler in before.items():
            signal.signal(ending, handler)
