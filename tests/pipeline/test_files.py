import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.files import (
    atomic_write,
    check_folder,
    check_regular,
    load_arrays,
    make_folder,
    read_numbers,
    read_text,
    run_all,
    run_isolated,
)
from tests.source_tree import ROOT


def test_the_file_appears_when_it_is_whole(tmp_path):
    path = tmp_path / "a.txt"
    with atomic_write(path) as partial:
        partial.write_text("new")
        assert not path.exists()
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_an_error_leaves_the_old_file_and_no_rest(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), atomic_write(path) as partial:
        partial.write_text("half")
        raise KeyboardInterrupt
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_place_that_cannot_be_written_is_named():
    with pytest.raises(InputError, match=r"/dev/full/a\.txt"), atomic_write(Path("/dev/full/a.txt")) as partial:
        partial.write_text("x")


def test_results_go_into_new_or_empty_folders_and_beside_those_that_they_continue(tmp_path: Path) -> None:
    for _ in range(2):
        make_folder(tmp_path / "a" / "b")
    assert list((tmp_path / "a" / "b").iterdir()) == []
    (tmp_path / "a" / "b" / "report.json.part").touch()  # of a run that was killed
    check_folder(tmp_path / "a" / "b")
    (tmp_path / "a" / "b" / "notes.txt").touch()
    with pytest.raises(InputError, match=r"b: contains notes\.txt but no sweep\.json; choose"):
        check_folder(tmp_path / "a" / "b", ["sweep.json"])
    (tmp_path / "a" / "b" / "sweep.json").touch()
    check_folder(tmp_path / "a" / "b", ["sweep.json"])
    with pytest.raises(InputError, match=r"b: contains notes\.txt; choose a new or empty folder$"):
        check_folder(tmp_path / "a" / "b")
    (tmp_path / "a" / "b" / "report.json").touch()
    with pytest.raises(InputError, match=r"b: contains an earlier run; choose"):
        check_folder(tmp_path / "a" / "b")


def test_a_file_or_a_place_without_room_is_no_folder_for_results(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for path in (tmp_path / "file", tmp_path / "file" / "a", Path("/proc/a")):
        for use in (make_folder, check_folder):  # The latter early, before anything is computed
            with pytest.raises(InputError, match=f"{path}: cannot be (used as a folder|created or written to): N"):
                use(path)
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


def test_all_actions_run_and_no_failure_is_lost() -> None:
    done: list[str] = []

    def fail(text: str) -> None:
        raise InputError(text)

    with pytest.raises(InputError, match=r"^first$"):
        run_all(lambda: done.append("a"), lambda: fail("first"), lambda: done.append("b"))
    assert done == ["a", "b"]
    with pytest.raises(ExceptionGroup) as raised:
        run_all(lambda: fail("first"), lambda: run_all(lambda: fail("second"), lambda: fail("third")))
    assert [str(error) for error in raised.value.exceptions] == ["first", "second", "third"]


def answer(text: str) -> str:
    """Answer, and print something else, as libraries do."""
    print("noise", flush=True)
    os.write(2, b"noise")
    return text + "!"


def run_forever() -> str:
    while True:
        pass


def crash() -> str:
    os.abort()


def fill_memory() -> str:
    return str(np.ones(3 * 10**8).sum())


def test_a_function_that_hangs_crashes_or_fills_the_memory_does_no_harm() -> None:
    limits = {"seconds": 3, "memory": 10**9}
    assert run_isolated(answer, "Z\xfcrich", **limits) == "Z\xfcrich!"
    assert run_isolated(answer, "x" * 10**6, **limits) == "x" * 10**6 + "!"
    for harmful in (run_forever, crash, fill_memory):
        assert run_isolated(harmful, **limits) == ""


def test_a_script_without_a_main_guard_and_with_busy_threads_is_answered(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import threading\n"
        "from pipeline.files import run_isolated\n"
        "from tests.pipeline.test_files import answer\n"
        "lock = threading.RLock()\n"
        "threading.Thread(target=lambda: lock.acquire() and threading.Event().wait(), daemon=True).start()\n"
        "print(run_isolated(answer, 'one', seconds=3, memory=10**9))\n"
    )
    done = subprocess.run(
        [sys.executable, script], env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True
    )
    assert (done.stdout, done.stderr) == ("one!\n", "")


def test_only_regular_files_of_bounded_size_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "text").write_text("12345")
    for path in (tmp_path, tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(InputError, match=f"{path}: "):
            read_text(path)
    with pytest.raises(InputError, match="No such file"):
        check_regular(tmp_path / "nothing")
    assert read_text(tmp_path / "text", 5) == "12345"
    with pytest.raises(InputError, match="has 5 bytes; the limit is 4 bytes"):
        read_text(tmp_path / "text", 4)


def test_a_text_is_utf_8_with_or_without_a_mark(tmp_path: Path) -> None:
    path = tmp_path / "text"
    path.write_bytes(b"\xef\xbb\xbfZ\xc3\xbcrich")
    assert read_text(path) == "Zürich"
    path.write_bytes(b"Z\xfcrich")
    with pytest.raises(InputError, match=r"byte 2 \(0xfc\) is invalid"):
        read_text(path)


def test_numbers_are_finite_and_as_many_as_the_columns(tmp_path: Path) -> None:
    path = tmp_path / "text"
    path.write_text("# a comment\n1 2.5 # another\n\n-3e2 4\n")
    np.testing.assert_array_equal(read_numbers(path, "a b"), [(1, 2.5), (-300, 4)])
    faults = {"": None, "1 2 3": 1, "1 2\n3": 2, "1 x": 1, "1 nan": 1, "1 1e999": 1}
    for text, line in faults.items():
        path.write_text(text)
        where = "contains no numbers; " if line is None else f"line {line} must contain 2 finite "
        with pytest.raises(InputError, match=f"{where}.*a b"):
            read_numbers(path, "a b")


def test_a_header_of_many_brackets_is_one_line(tmp_path: Path) -> None:
    header = ("(" * 100).ljust(117).encode() + b"\n"
    with zipfile.ZipFile(tmp_path / "map.npz", "w") as file:
        file.writestr("a.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header)
    with pytest.raises(InputError, match="not a readable map") as raised:
        load_arrays(tmp_path / "map.npz", "map")
    assert "\n" not in str(raised.value)
