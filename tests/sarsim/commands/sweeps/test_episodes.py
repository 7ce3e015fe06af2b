"""Episodes of a sweep: their rows, and what goes wrong in a method."""

import json
import signal
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from sarsim.commands.sweeps.episodes import EpisodeResult, SweepJob, grid_explorer, limited, result_of, run_episode
from sarsim.scoring.progress import area_under
from sarsim.tasks.grid_explorers import Sights
from sarsim.tasks.grid_scenes import draw_scene
from sarsim.tasks.grid_world import PAPERS, GridWorld

MINE = """
class Wrong:
    answer = float("nan")

    def __call__(self, world, sights, rng):
        return self.answer


class Outside(Wrong):
    answer = 10**9


class Throws:
    def __call__(self, world, sights, rng):
        raise ValueError("a line\\nand another")


class Hangs:
    def __call__(self, world, sights, rng):
        while True:
            pass


class First:
    def __call__(self, world, sights, rng):
        return sights.nodes[sights.visible.any(axis=1).argmax()]
"""


WHOLE = {"row": {}, "curve": {"time_s": [0, 1], "way_m": [0, 1], "explored": [0.1, 0.2]}, "processor_s": 1}
BROKEN = [WHOLE | {"row": 3}, WHOLE | {"curve": {}}, WHOLE | {"curve": WHOLE["curve"] | {"way_m": [0]}}]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Runs a method of a module in the working folder on a map."""
    (tmp_path / "mine_2d.py").write_text(MINE)
    monkeypatch.chdir(tmp_path)

    def run(method: str, limit: float = 60.0) -> EpisodeResult:
        job = SweepJob(method, "grid:test:2", 0)
        run_episode(10, limit, job, tmp_path)
        found = result_of(job, tmp_path)
        assert found is not None
        return found

    return run


def test_a_row_has_the_figures_of_a_report_and_is_the_same_again(run) -> None:
    row, _, seconds = run("nearest_frontier")
    assert (row["method"], row["arena"], row["seed"], row["exploration.ended"]) == (
        "nearest_frontier", "grid:test:2", 0, "nothing_left",
    )  # fmt: skip
    assert 0 < row["exploration.t90_s"] < row["exploration.t99_s"] <= row["sim_time_s"]
    assert 0 < row["exploration.auc_way"] < row["navigation.distance_m"]
    assert seconds > 0 and run("nearest_frontier").row == row


def test_a_curve_is_that_of_the_row_s_figures_and_has_no_place_where_nothing_new_was_seen(run) -> None:
    row, curve, _ = run("nearest_frontier")
    assert area_under(curve.time_s, curve.explored, row["sim_time_s"]) == approx(row["exploration.auc_time"])
    assert area_under(curve.way_m, curve.explored, row["navigation.distance_m"]) == approx(row["exploration.auc_way"])
    assert curve.explored[-1] == pytest.approx(row["exploration.explored_fraction"], abs=5e-5)
    assert (np.diff(curve.explored) > 0).all() and len(curve.explored) < row["steps"]


def approx(area: float):
    """To the digits that a curve keeps."""
    return pytest.approx(area, rel=1e-4)


def test_a_class_of_ones_own_explores(run) -> None:
    assert run("mine_2d:First").row["exploration.explored_fraction"] > 0.9


@pytest.mark.parametrize(
    ("method", "complaint"),
    [
        ("mine_2d:Wrong", r"^--methods mine_2d:Wrong: returned nan, .*node$"),
        ("mine_2d:Outside", "returned 1000000000, .*node$"),
        ("mine_2d:Throws", "^--methods mine_2d:Throws failed: ValueError: a line and another$"),
        ("mine_2d:Hangs", "TimeoutError: .* 1 s$"),
        (
            "missing_2d:Mine",
            "^--methods missing_2d:Mine cannot be loaded: ModuleNotFoundError: No module named 'missing_2d'$",
        ),
        ("nearest", "^--methods nearest: .*next_best_view, .* or MODULE:CLASS$"),
    ],
)
def test_what_is_wrong_with_a_method_is_said_in_one_line(run, method: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        run(method, limit=1.0 if "Hangs" in method else 60.0)


def test_methods_see_the_map_and_no_more() -> None:
    world = GridWorld(draw_scene(2_000_002, (480, 640), 20, 1.0), PAPERS)
    node = grid_explorer("nearest_frontier")(world, Sights.of(world), np.random.default_rng(0))
    assert np.isfinite(world.ways(world.here)[0][node])


def test_a_block_that_ends_in_time_is_left_alone() -> None:
    with limited(60.0):
        assert signal.getitimer(signal.ITIMER_REAL)[0] > 0
    assert signal.getitimer(signal.ITIMER_REAL)[0] == 0


def test_files_of_different_episodes_have_different_names() -> None:
    jobs = [SweepJob(m, a, s) for m in ("a:B", "a_B") for a in ("x/y.raf", "x_y.raf") for s in (0, 1)]
    assert len({job.file for job in jobs}) == len(jobs)


@pytest.mark.parametrize("text", ["{", "[]", *map(json.dumps, BROKEN)])
def test_a_broken_result_is_reported(tmp_path: Path, text: str) -> None:
    job = SweepJob("m", "a", 0)
    (tmp_path / "episodes").mkdir()
    (tmp_path / job.file).write_text(text)
    with pytest.raises(InputError, match=r"not a valid episode result .*; delete it"):
        result_of(job, tmp_path)
    (tmp_path / job.file).write_text(json.dumps(WHOLE))
    assert result_of(job, tmp_path).processor_s == 1
