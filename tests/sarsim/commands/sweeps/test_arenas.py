"""Names of arenas, and splits that stay what they were."""

from pathlib import Path

import pytest

from pipeline.errors import InputError
from sarsim.commands.sweeps import arenas
from sarsim.commands.sweeps.arenas import (
    SPLITS,
    arenas_of,
    check_names,
    checksum,
    frozen_checksums,
    verified_checksum,
)


def test_splits_share_no_arena() -> None:
    names = [name for split in SPLITS for name in frozen_checksums(split)]
    sums = [total for split in SPLITS for total in frozen_checksums(split).values()]
    assert len(set(names)) == len(set(sums)) == 36


@pytest.mark.parametrize("name", ["nist_6x4", "random:1000000"])
def test_frozen_arenas_are_what_they_were(name: str) -> None:
    assert verified_checksum(name) in [
        frozen_checksums(split)[name] for split in SPLITS if name in frozen_checksums(split)
    ]


def test_an_arena_that_has_changed_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arenas, "checksum", lambda name: "other")
    with pytest.raises(InputError, match="nist_6x4"):
        verified_checksum("nist_6x4")
    assert verified_checksum("random:7") == "other"  # is in no split


def test_a_lane_and_a_function_of_ones_own_are_arenas_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "own_hall.py").write_text(
        "from sarsim.arenas.load import load_arena\n\n\ndef hall():\n    return load_arena('nist_6x4')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    check_names([], ["lanes/maze", "own_hall:hall"])
    assert checksum("own_hall:hall") != checksum("lanes/maze") == checksum("lanes/maze")


def test_names_stand_for_splits_and_arenas() -> None:
    assert arenas_of(["test", "nist_6x4", "random:3"]) == [*frozen_checksums("test"), "random:3"]
