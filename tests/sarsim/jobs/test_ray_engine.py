"""Scenes made by Ray's tasks: the same bytes as in this process."""

from dataclasses import replace
from pathlib import Path

import pytest
from ray.cluster_utils import Cluster

from pipeline.errors import InputError
from sarsim.dataset.generate import generate
from sarsim.jobs.ray_engine import RayEngine
from tests.sarsim.dataset.small import RECIPE, InProcess, files


def test_what_goes_wrong_in_a_task_is_reported(tmp_path: Path) -> None:
    recipe = replace(RECIPE, arenas=(str(tmp_path / "missing.xml"),))
    with pytest.raises(InputError, match=r"missing\.xml"):
        generate(recipe, 1, tmp_path / "data", RayEngine(1))


def test_a_cluster_that_loses_one_of_two_nodes_completes_a_dataset_with_the_same_bytes(tmp_path: Path) -> None:
    generate(RECIPE, 1, tmp_path / "ray" / "data", InProcess())
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    nodes, seen = [cluster.add_node(num_cpus=1)], list[int]()

    def lose_a_node(frames: int) -> None:
        seen.append(frames)
        while frames > RECIPE.frames and nodes:
            cluster.remove_node(nodes.pop(), allow_graceful=False)

    try:
        generate(RECIPE, 4, tmp_path / "ray" / "data", RayEngine(2, cluster.address), lose_a_node)
    finally:
        cluster.shutdown()
    generate(RECIPE, 4, tmp_path / "here" / "data", InProcess())
    assert not nodes and seen[0] == RECIPE.frames and seen[-1] == 4 * RECIPE.frames
    assert files(tmp_path / "ray") == files(tmp_path / "here")
