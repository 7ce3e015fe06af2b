from pathlib import Path

import pytest

from pipeline.errors import InputError
from pipeline.files import check_folder, each, make_folder, whole_file


def test_the_file_appears_when_it_is_whole(tmp_path):
    path = tmp_path / "a.txt"
    with whole_file(path) as partial:
        partial.write_text("new")
        assert not path.exists()
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_an_error_leaves_the_old_file_and_no_rest(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), whole_file(path) as partial:
        partial.write_text("half")
        raise KeyboardInterrupt
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_place_that_cannot_be_written_is_named():
    with pytest.raises(InputError, match=r"/dev/full/a\.txt"), whole_file(Path("/dev/full/a.txt")) as partial:
        partial.write_text("x")


def test_results_go_into_new_or_empty_folders_and_over_earlier_results(tmp_path: Path) -> None:
    for _ in range(2):
        make_folder(tmp_path / "a" / "b")
    assert list((tmp_path / "a" / "b").iterdir()) == []
    (tmp_path / "a" / "b" / "report.json.part").touch()  # of a run that was killed
    check_folder(tmp_path / "a" / "b")
    (tmp_path / "a" / "b" / "notes.txt").touch()
    with pytest.raises(InputError, match=r"b: not empty: it holds notes.txt and no episode.rrd and no report.json$"):
        check_folder(tmp_path / "a" / "b")
    (tmp_path / "a" / "b" / "report.json").touch()
    check_folder(tmp_path / "a" / "b")
    with pytest.raises(InputError, match=r"b: not empty: it holds notes.txt$"):
        check_folder(tmp_path / "a" / "b", marks=())


def test_a_file_or_a_place_without_room_is_no_folder_for_results(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for path in (tmp_path / "file", tmp_path / "file" / "a", Path("/proc/a")):
        with pytest.raises(InputError, match=f"{path}: N"):
            make_folder(path)


def test_each_runs_what_remains_after_a_failure_and_then_raises_the_first() -> None:
    done: list[str] = []

    def fail(text: str) -> None:
        raise InputError(text)

    with pytest.raises(InputError, match="first"):
        each(lambda: done.append("a"), lambda: fail("first"), lambda: done.append("b"), lambda: fail("second"))
    assert done == ["a", "b"]
