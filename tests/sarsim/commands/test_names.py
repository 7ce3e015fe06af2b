"""Names that are not there are refused in one line, before anything that takes seconds is imported."""

from pathlib import Path

import pytest

from sarsim.arenas.load import BUILDERS
from sarsim.arenas.names import BUILT_EXTENSIONS, BUILT_IN, check_arena_name
from sarsim.assets import asset
from sarsim.settings import EpisodeConfig


def test_the_names_are_those_of_what_is_there() -> None:
    assert set(BUILT_EXTENSIONS) == set(BUILDERS)
    assert all(asset("arenas", f"{name}.xml").exists() for name in BUILT_IN)
    for name in (*BUILT_IN, "random:3"):
        check_arena_name(name)


@pytest.mark.parametrize(
    ("arena", "name"),
    [
        ("nist_6x4", "nist_6x4-2"),
        ("random:7", "random-7-2"),
        ("lanes/krails", "krails-2"),
        ("worlds/my world?.sdf", "my-world--2"),
        ("my.arenas:build", "my.arenas-build-2"),
    ],
)
def test_a_run_gets_a_folder_of_its_own_with_a_portable_name(
    arena: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    config = EpisodeConfig(arena=arena, seed=2)
    assert config.folder == Path("runs", name)
    config.folder.mkdir(parents=True)
    assert config.folder == Path("runs", f"{name}-2")
    (tmp_path / "runs" / f"{name}-2").mkdir()
    assert config.folder == Path("runs", f"{name}-3")
