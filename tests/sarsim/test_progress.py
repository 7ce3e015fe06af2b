"""Progress on a terminal."""

import pytest

from sarsim.progress import shown_run


def test_brackets_are_text(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")  # Rich takes stderr for a terminal
    monkeypatch.setenv("TERM", "xterm")
    with shown_run("a[/b]"):
        pass
    assert "a[/b]" in capsys.readouterr().err
