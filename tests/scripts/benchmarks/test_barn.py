"""The rules of the BARN challenge, on cases worked out by hand."""

import io
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.transforms import from_yaw
from scripts.benchmarks.barn import BarnJudge, optimal_seconds, read_path, score


def judged(*poses: tuple[float, float, float], contacts: int = 0) -> BarnJudge:
    """A judge that has seen (s, x, y), m, until it ended the run; the contacts come with the last."""
    judge = BarnJudge(set_down_time=0.5)
    for n, (time, x, y) in enumerate(poses, 1):
        if not judge.see(time, from_yaw(x, y, 0, np.pi / 2), contacts if n == len(poses) else 0):
            assert n == len(poses)
    return judge


def test_the_clock_starts_when_the_robot_has_moved_and_ends_a_metre_before_the_goal() -> None:
    judge = judged((1.0, -2.25, 3.05), (3.0, -2.25, 3.15), (20.0, -2.25, 11.95), (21.0, -1.85, 12.2))
    assert (judge.ended, judge.seconds) == ("reached", 18.0)


def test_a_contact_ends_a_run_even_at_the_goal() -> None:
    assert judged((3.0, -2.25, 3.2), (20.0, -2.25, 12.5), contacts=1).ended == "contact"


@pytest.mark.parametrize(
    "poses", [[(50.0, -2.25, 3.5), (149.0, -2.25, 6.0), (150.0, -2.25, 6.0)], [(100.5, -2.25, 3.0)]]
)
def test_a_hundred_seconds_end_a_run_also_of_a_robot_that_never_sets_out(
    poses: list[tuple[float, float, float]],
) -> None:
    assert judged(*poses).ended == "time"
    assert judged(*poses[:-1]).ended is None


def test_the_score_is_the_reference_s_time_over_that_taken_within_bounds() -> None:
    assert score(None, 5.0) == 0
    assert [score(seconds, 5.0) for seconds in (1.0, 10.0, 20.0, 40.0, 99.0)] == [0.5, 0.5, 0.25, 0.125, 0.125]


def test_the_reference_path_leads_from_the_start_over_its_cells_to_the_goal() -> None:
    # Cell (0, 0) lies at (-4.575, 5.075), cell (20, 40) at (-1.575, 11.075).
    lengths = np.hypot(2.325, 2.075) + np.hypot(3, 6) + np.hypot(0.675, 1.925)
    assert optimal_seconds(np.array([[0.0, 0.0], [20.0, 40.0]])) == pytest.approx(lengths / 2)


def npy(cells: object) -> bytes:
    np.save(file := io.BytesIO(), np.array(cells))
    return file.getvalue()


@pytest.mark.parametrize(
    "content",
    [b"", b"PK\x03\x04", npy([[1, 2]])[:-3], npy([1, 2]), npy([[1.0, np.nan]]), npy([["a", "b"]]), npy([[None, 1]])],
)
def test_a_file_that_is_no_path_is_refused(tmp_path: Path, content: bytes) -> None:
    (file := tmp_path / "path_1.npy").write_bytes(npy([[3, 4], [3, 5]]))
    assert read_path(file).tolist() == [[3.0, 4.0], [3.0, 5.0]]
    file.write_bytes(content)
    with pytest.raises(InputError, match=r"path_1\.npy"):
        read_path(file)
