"""Names of arenas, and splits that stay what they were."""

import pytest

from pipeline.errors import InputError
from sarsim.commands.sweeps import arenas
from sarsim.commands.sweeps.arenas import SPLITS, arenas_of, checked, frozen


def test_splits_share_no_arena() -> None:
    names = [name for split in SPLITS for name in frozen(split)]
    sums = [total for split in SPLITS for total in frozen(split).values()]
    assert len(set(names)) == len(set(sums)) == 36


@pytest.mark.parametrize("name", ["nist_6x4", "random:1000000"])
def test_frozen_arenas_are_what_they_were(name: str) -> None:
    assert checked(name) in [frozen(split)[name] for split in SPLITS if name in frozen(split)]


def test_an_arena_that_has_changed_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arenas, "checksum", lambda name: "other")
    with pytest.raises(InputError, match="nist_6x4"):
        checked("nist_6x4")
    assert checked("random:7") == "other"  # is in no split


def test_names_stand_for_splits_and_arenas() -> None:
    assert arenas_of(["test", "nist_6x4", "random:3"]) == [*frozen("test"), "random:3"]
