"""Scenes made by Ray's tasks: the same bytes as in this process. Skipped where Ray is not installed."""

from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.errors import InputError
from sarsim.dataset.generate import generate
from sarsim.dataset.ray_engine import RayEngine
from tests.sarsim.dataset.in_process import InProcess, files
from tests.sarsim.dataset.small import RECIPE

pytest.importorskip("ray")


def test_ray_makes_the_same_bytes_and_completes_a_dataset(tmp_path: Path) -> None:
    generate(RECIPE, 2, tmp_path / "here" / "data", InProcess())
    generate(RECIPE, 1, tmp_path / "ray" / "data", InProcess())
    seen: list[int] = []
    generate(RECIPE, 2, tmp_path / "ray" / "data", RayEngine(1), seen.append)
    assert seen[0] == RECIPE.frames and seen[-1] == 2 * RECIPE.frames
    assert files(tmp_path / "ray") == files(tmp_path / "here")


def test_what_goes_wrong_in_a_task_is_told(tmp_path: Path) -> None:
    recipe = replace(RECIPE, arenas=(str(tmp_path / "missing.xml"),))
    with pytest.raises(InputError, match=r"missing.xml: No such file"):
        generate(recipe, 1, tmp_path / "data", RayEngine(1))
