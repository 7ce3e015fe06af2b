"""Threads that share rows of a block, or blocks."""

import numpy as np
import pytest
import torch

from pipeline.semantic_map.networks.dgcnn_cpu.inference import tiles
from pipeline.semantic_map.networks.threads import Threads


def test_threads_cover_every_row_once_and_leave_torch_its_threads() -> None:
    before = torch.get_num_threads()
    visits, threads_inside = np.zeros(1000, int), set()

    def visit(rows: slice) -> None:
        visits[rows] += 1
        threads_inside.add(torch.get_num_threads())

    threads = Threads(2)
    threads.run(lambda: threads.over(tiles(1000), visit))
    assert (visits == 1).all()
    assert threads_inside == {1}
    assert torch.get_num_threads() == before


@pytest.mark.parametrize("count", [1, 3])
def test_an_error_in_a_thread_is_raised(count: int) -> None:
    def fail(rows: slice) -> None:
        raise ValueError(rows)

    threads = Threads(count)
    with pytest.raises(ValueError, match="slice"):
        threads.run(lambda: threads.over([slice(0, 4), slice(4, 8)], fail))


def test_each_item_is_computed_alone_and_answers_come_in_order() -> None:
    def answer(item: int) -> tuple[int, int, bool]:
        return item, torch.get_num_threads(), torch.is_inference_mode_enabled()

    assert list(Threads(2).each(range(50), answer)) == [(item, 1, True) for item in range(50)]
