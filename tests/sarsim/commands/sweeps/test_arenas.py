"""Names of arenas, and splits that stay what they were."""

from pathlib import Path

import pytest

from pipeline.errors import InputError
from sarsim.commands.sweeps import arenas
from sarsim.commands.sweeps.arenas import ARENAS, MAPS, arenas_of, checked, checksum, frozen
from sarsim.tasks.grid_scenes import DRAWINGS


def test_splits_share_no_arena() -> None:
    for tier, count in (("grid", MAPS), ("mujoco", ARENAS)):
        names = [name for split in DRAWINGS for name in frozen(split)[tier]]
        sums = [total for split in DRAWINGS for total in frozen(split)[tier].values()]
        assert len(set(names)) == len(set(sums)) == 3 * count


@pytest.mark.parametrize("name", ["grid:train:0", "grid:val:99", "grid:test:7", "nist_6x4", "random:1000000"])
def test_frozen_arenas_are_what_they_were(name: str) -> None:
    assert checked(name) in [tier[name] for split in DRAWINGS for tier in frozen(split).values() if name in tier]


def test_an_arena_that_has_changed_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arenas, "SIZES", {"papers": ((400, 640), 20, 1.0)})
    assert checksum("grid:test:0") != frozen("test")["grid"]["grid:test:0"]
    with pytest.raises(InputError, match="grid:test:0"):
        checked("grid:test:0")
    checked("grid:test:100")  # is in no split


def test_names_stand_for_splits_folders_and_arenas(tmp_path: Path) -> None:
    (tmp_path / "b.png").touch()
    assert arenas_of(["grid:test"]) == [f"grid:test:{number}" for number in range(MAPS)]
    assert arenas_of(["test", "nist_6x4", "random:3"]) == [*frozen("test")["mujoco"], "random:3"]
    assert arenas_of([f"grid:{tmp_path}", "grid:val:3"]) == [f"grid:{tmp_path}/b.png", "grid:val:3"]


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ([], "--arenas: give at least one arena"),
        (["nist_6x4", "grid:test"], "--arenas nist_6x4 grid:test: 2D maps .* cannot be mixed"),
    ],
)
def test_either_maps_or_arenas(names: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        arenas_of(names)


@pytest.mark.parametrize("name", ["grid:tset:1", "grid:test:x", "grid:/dev/null"])
def test_a_map_that_is_none(name: str) -> None:
    with pytest.raises(InputError):
        checksum(name)
