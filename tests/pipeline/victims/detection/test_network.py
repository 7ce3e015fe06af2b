"""The network and its weights' files, against OpenCV's own reader."""

from hashlib import sha256
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.victims.detection.darknet_cfg import DarknetCfg, Maxpool, YoloHead
from pipeline.victims.detection.inference import FusedNetwork, to_tensor
from pipeline.victims.detection.network import DarknetMaxpool, DarknetNetwork
from pipeline.victims.detection.weights import load_network, read_weights, write_weights
from tests.pipeline.victims.detection.networks import FULL, OWN, SMALL, TINY, random_network

PUBLISHED_BYTES = {TINY: 35434956, FULL: 248007048}  # of yolov3-tiny.weights and yolov3.weights


def image_for(network: DarknetNetwork) -> np.ndarray:
    cfg = network.cfg
    return np.random.default_rng(0).integers(0, 256, (cfg.height, cfg.width, 3), np.uint8)


def outputs(network: DarknetNetwork, image: np.ndarray) -> list[np.ndarray]:
    with torch.inference_mode():
        return [head.numpy() for head in network(to_tensor(image[None]))]


def heads(network: DarknetNetwork) -> list[int]:
    return [i for i, layer in enumerate(network.cfg.layers) if isinstance(layer, YoloHead)]


@pytest.mark.parametrize("text", [TINY, FULL, OWN], ids=["tiny", "full", "small"])
def test_opencv_reads_the_same_network_from_the_same_files(text: str, tmp_path: Path) -> None:
    network = random_network(text)
    cfg, weights = tmp_path / "n.cfg", tmp_path / "n.weights"
    cfg.write_text(text)
    write_weights(weights, network, seen=7)
    if text in PUBLISHED_BYTES:
        assert weights.stat().st_size == PUBLISHED_BYTES[text]
    image = image_for(network)
    peer = cv2.dnn.readNetFromDarknet(str(cfg), str(weights))
    peer.setInput(cv2.dnn.blobFromImage(image, 1 / 255))
    theirs = peer.forward([f"conv_{i - 1}" for i in heads(network)])
    ours = outputs(load_network(cfg, weights), image)
    assert len(ours) == len(theirs)
    for mine, other in zip(ours, theirs, strict=True):
        assert mine.shape == other.shape
        assert 0.05 < mine.std() < 100
        np.testing.assert_allclose(mine, other, atol=1e-3, rtol=0)


@pytest.mark.parametrize("text", [TINY, OWN, SMALL], ids=["tiny", "ours", "small"])
def test_the_fast_network_computes_the_same(text: str) -> None:
    network = random_network(text)
    image = image_for(network)
    for fast, plain in zip(FusedNetwork(network)(image), outputs(network, image), strict=True):
        np.testing.assert_allclose(fast, plain[0], atol=1e-4, rtol=0)


def test_a_convolution_by_hand(tmp_path: Path) -> None:
    """One layer, 1×1, all of whose numbers are set in the file: order and meaning of each."""
    text = "[net]\nwidth=1\nheight=1\nchannels=1\n" + (
        "[convolutional]\nbatch_normalize=1\nfilters=6\nsize=1\nactivation=leaky\n"
        "[yolo]\nmask=0\nanchors=1,1\nclasses=1\nnum=1\n"
    )
    bias, scale, mean, variance, kernel = 1.0, 2.0, 3.0, 4.0, 5.0
    numbers = np.repeat([bias, scale, mean, variance, kernel], 6).astype("<f4")
    path = tmp_path / "n.weights"
    path.write_bytes(np.array([0, 1, 0, 9], "<i4").tobytes() + numbers.tobytes())  # version 0.1: int32 seen
    network = DarknetNetwork(DarknetCfg.parse(text)).eval()
    assert read_weights(path, network) == 9
    x = torch.tensor([[[[0.4]]]])
    assert network(x)[0].flatten().tolist() == pytest.approx([0.0] * 6, abs=1e-5)  # 2 (5 · 0.4 − 3) / 2 + 1
    assert network(0 * x)[0].flatten().tolist() == pytest.approx([-0.2] * 6, abs=1e-5)  # 0.1 · (−3 + 1)


@given(size=st.integers(1, 4), stride=st.integers(1, 3), extent=st.integers(3, 9), seed=st.integers(0, 99))
def test_maxima_are_darknets(size: int, stride: int, extent: int, seed: int) -> None:
    """Darknet's maxpool_layer.c: windows from −padding/2 on, what lies outside counts as −FLT_MAX."""
    padding = size - 1
    x = np.random.default_rng(seed).normal(size=(extent, extent))
    count = (extent + padding - size) // stride + 1
    expected = np.empty((count, count))
    for i, j in np.ndindex(count, count):
        rows = [r for r in range(i * stride - padding // 2, i * stride - padding // 2 + size) if 0 <= r < extent]
        cols = [c for c in range(j * stride - padding // 2, j * stride - padding // 2 + size) if 0 <= c < extent]
        expected[i, j] = x[np.ix_(rows, cols)].max()
    result = DarknetMaxpool(Maxpool(size, stride, padding), extent, extent)(torch.tensor(x)[None, None])
    np.testing.assert_array_equal(result[0, 0], expected)


def test_weights_survive_being_written(tmp_path: Path) -> None:
    network, other = random_network(SMALL), random_network(SMALL, seed=1)
    write_weights(tmp_path / "n.weights", network, seen=2**40)
    assert read_weights(tmp_path / "n.weights", other) == 2**40
    for name, tensor in network.state_dict().items():
        torch.testing.assert_close(other.state_dict()[name], tensor, rtol=0, atol=0)


def test_safetensors_keep_kernels_in_half_precision(tmp_path: Path) -> None:
    network, path = random_network(SMALL), tmp_path / "n.safetensors"
    write_weights(path, network, seen=9)
    (tmp_path / "n.cfg").write_text(SMALL)
    assert read_weights(path, random_network(SMALL, seed=1)) == 9
    loaded = load_network(path).state_dict()
    for name, tensor in network.state_dict().items():
        torch.testing.assert_close(loaded[name], tensor.half().float() if tensor.ndim > 1 else tensor)
    wider = random_network(SMALL.replace("size=3", "size=5"))
    with pytest.raises(InputError, match=r"layers\.0\.conv\.weight"):
        read_weights(path, wider)


@pytest.mark.parametrize("ending", ["weights", "safetensors"])
def test_weights_must_have_the_hash_that_is_written_beside_them(ending: str, tmp_path: Path) -> None:
    network, path = random_network(SMALL), tmp_path / f"n.{ending}"
    write_weights(path, network)
    beside = path.with_name(f"{path.name}.sha256")
    beside.write_text(f"{sha256(path.read_bytes()).hexdigest()}  {path.name}\n")
    read_weights(path, network)
    for wrong in (64 * "0", ""):
        beside.write_text(wrong)
        with pytest.raises(InputError, match=rf"{wrong} .*n\.{ending}\.sha256"):
            read_weights(path, network)


def test_wrong_weights_are_refused(tmp_path: Path) -> None:
    network, path = random_network(SMALL), tmp_path / "n.weights"
    write_weights(path, network)
    good = path.read_bytes()
    for content, message in (
        (good[:-4], "too short for cfg"),
        (good + b"\0", "too long"),
        (good[:10], "too short"),
        (b"PK\3\4" + good[4:], "not Darknet weights"),
        (good[:-4] + np.float32(np.nan).tobytes(), "not finite"),
    ):
        path.write_bytes(content)
        with pytest.raises(InputError, match=message):
            read_weights(path, network)
    with pytest.raises(InputError, match="No such file"):
        read_weights(tmp_path / "none", network)


def test_layers_that_do_not_fit_are_refused() -> None:
    for old, new, message in (
        ("filters=6", "filters=5", "filters=6 before it, not 5"),
        ("[yolo]", "[route]\nlayers=-1,-2\n[shortcut]\nfrom=0\nactivation=linear\n[yolo]", "other sizes: 2×4×8"),
        ("[yolo]", "[scale_channels]\nfrom=0\n[yolo]", "other sizes: 2×4×8, 6×4×8"),
        ("[yolo]", "[route]\nlayers=0\ngroups=3\ngroup_id=1\n[yolo]", "groups=3 do not divide the channels of 2×4×8"),
        ("size=1", "size=1\ngroups=3", "groups=3 do not divide 2 channels"),
        ("[yolo]", "[upsample]\nstride=2\n[route]\nlayers=-1,0\n[yolo]", "other sizes: 6×8×16, 2×4×8"),
        ("size=1", "size=9", "nothing is left"),
    ):
        with pytest.raises(InputError, match=message):
            DarknetNetwork(DarknetCfg.parse(SMALL.replace(old, new)))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("width=16\nheight=8", "width=60000\nheight=60000", "too large: .* numbers for an image"),
        ("filters=2\nsize=3", "filters=65535\nsize=64", "too large: .* weights"),
        ("channels=3", "channels=65535\n[upsample]\nstride=64\n[upsample]\nstride=64", "too large"),
    ],
)
def test_a_network_of_absurd_size_is_refused_before_it_is_built(old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        DarknetNetwork(DarknetCfg.parse(SMALL.replace(old, new)))


def test_yolov3_for_large_images_is_not_refused() -> None:
    text = FULL.replace("width=160", "width=1024").replace("height=128", "height=1024")
    with torch.device("meta"):
        assert DarknetNetwork(DarknetCfg.parse(text)).shapes[0] == (32, 1024, 1024)


def test_variances_below_0_are_refused(tmp_path: Path) -> None:
    network = random_network(SMALL)
    network.convolutions[0].norm.running_var[1] = -1
    write_weights(tmp_path / "n.weights", network)
    with pytest.raises(InputError, match="variances below 0"):
        read_weights(tmp_path / "n.weights", network)
