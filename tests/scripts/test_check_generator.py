"""check_generator.py: a generator that is killed or out of space loses nothing, and what is lost is noticed."""

from pathlib import Path

import pytest

from sarsim.scripts import check_generator as checks
from sarsim.scripts.check_generator import CheckConfig, check_same, check_whole, checksums
from sarsim.scripts.cli import run
from tests.sarsim.dataset.in_process import toys


def test_kills_and_a_full_disk_lose_nothing(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def in_the_nist_arena(config: CheckConfig, folder: Path) -> list[str]:
        return [*command(config, folder), "--arenas", "nist_6x4"]

    command = CheckConfig.command
    monkeypatch.setattr(CheckConfig, "command", in_the_nist_arena)
    run(
        checks.check_generator,
        [f"--{flag}" for flag in ("kills=2", "scenes=2", "frames=2", "workers=1", "seed=2")],
    )
    said = " ".join(capsys.readouterr().out.split())
    assert "cannot be written: File too large" in said
    assert "the same 4 files as undisturbed" in said


@pytest.mark.parametrize("change", [b"", b"other"])
def test_what_is_lost_or_not_whole_is_caught(tmp_path: Path, change: bytes) -> None:
    toys(tmp_path, 2)
    expected = checksums(tmp_path)
    check_same(tmp_path, expected)
    check_whole(tmp_path, expected)
    scene = tmp_path / "scenes" / "00001.h5"
    scene.write_bytes(change)
    with pytest.raises(SystemExit, match=r"unlike an undisturbed run: scenes/00001.h5"):
        check_same(tmp_path, expected)
    with pytest.raises(SystemExit, match=r"scenes/00001.h5 is not whole"):
        check_whole(tmp_path, expected)
    scene.unlink()
    check_whole(tmp_path, expected)
    with pytest.raises(SystemExit, match=r"unlike an undisturbed run: scenes/00001.h5"):
        check_same(tmp_path, expected)
