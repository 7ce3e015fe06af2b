"""Fast inference against the network as it is written."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.semantic_map.networks.dgcnn import Dgcnn
from pipeline.semantic_map.networks.dgcnn_cpu import inference_kernels
from pipeline.semantic_map.networks.dgcnn_cpu.inference import FastDgcnn
from tests.pipeline.semantic_map.networks.small_network import block, network, plain


@pytest.mark.parametrize(("points", "channels", "classes"), [(20, 6, 6), (63, 9, 13), (300, 6, 6), (1000, 9, 13)])
def test_fast_gives_the_logits_of_the_network_as_written(points: int, channels: int, classes: int) -> None:
    dgcnn, x = network(channels, classes), block(points, channels)
    logits, expected = FastDgcnn(dgcnn, threads=2)(x), plain(dgcnn, x)
    assert logits.shape == (points, classes)
    assert np.median(np.abs(logits - expected)) < 1e-5
    assert (logits.argmax(axis=1) == expected.argmax(axis=1)).mean() >= 0.999


def test_the_result_does_not_depend_on_the_number_of_threads() -> None:
    dgcnn, x = network(), block(500)
    one, three = FastDgcnn(dgcnn, threads=1)(x), FastDgcnn(dgcnn, threads=3)(x)
    assert (one == three).all()


def test_duplicates_get_one_answer() -> None:
    dgcnn, x = network(), np.repeat(block(10), 7, axis=0)
    logits = FastDgcnn(dgcnn, threads=1)(x)
    assert np.ptp(logits.reshape(10, 7, -1), axis=1).max() < 1e-5


@pytest.mark.parametrize(
    "points", [block(19), block(30, channels=5), block(30)[:, 0], np.full((30, 6), np.nan, np.float32)]
)
def test_points_that_cannot_be_classified_are_refused(points: np.ndarray) -> None:
    with pytest.raises(InputError, match="dgcnn"):
        FastDgcnn(network(), threads=1)(points)


def test_more_neighbours_than_can_be_selected_are_refused() -> None:
    with pytest.raises(InputError, match="64"):
        FastDgcnn(Dgcnn(6, 6, k=65), threads=1)


@pytest.mark.parametrize("points", [20, 21, 64, 255, 256, 257, 700])
def test_selected_neighbours_are_the_nearest(points: int) -> None:
    x = block(points, channels=3, seed=points).astype(np.float64)
    product, half_square = (x @ x.T).astype(np.float32), ((x * x).sum(axis=1) / 2).astype(np.float32)
    neighbours = np.empty((points, 20), np.int32)
    inference_kernels.select_nearest(product, half_square, neighbours)
    order = np.argsort(-(product - half_square), axis=1, kind="stable")[:, :20]
    assert (np.sort(neighbours, axis=1) == np.sort(order, axis=1)).all()


def test_of_equally_close_points_the_lower_index_is_nearer() -> None:
    neighbours = np.empty((1, 3), np.int32)
    closeness = np.float32([[0, 1, 2, 1, 1, 2, 0, 1]])
    inference_kernels.select_nearest(closeness, np.zeros(8, np.float32), neighbours)
    assert sorted(neighbours[0].tolist()) == [1, 2, 5]


def test_blocks_can_be_classified_at_once_from_several_threads() -> None:
    fast, blocks = FastDgcnn(network(), threads=2), [block(200, seed=seed) for seed in range(6)]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(fast, blocks, timeout=60))
    assert all((logits == fast(x)).all() for logits, x in zip(together, blocks, strict=True))
