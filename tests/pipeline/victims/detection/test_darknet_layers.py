"""Every kind of layer and its settings, in small networks of random weights, against OpenCV's reader of Darknet."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from pipeline.victims.detection.boxes import decode, overlaps, suppress
from pipeline.victims.detection.darknet_cfg import DarknetCfg
from pipeline.victims.detection.inference import FusedNetwork, to_tensor
from pipeline.victims.detection.network import DarknetNetwork
from pipeline.victims.detection.weights import load_network, write_weights
from tests.pipeline.victims.detection.networks import random_network

SHARED = Path(__file__).parents[5] / "shared"
PHOTOS = SHARED / "real_photos"
PUBLISHED = {"yolo-fastest-1.1-xl": "coco_person", "yolo-fastest-1.1_body": "body"}
"""Networks by their names, and what their boxes are called in the photos' truth."""
WIDTH, HEIGHT, CONFIDENCE = 24, 16, 0.25
CONV = "[convolutional]\nfilters={}\nsize={}\npad=1\nbatch_normalize=1\nactivation={}\n"
FIRST = CONV.format(8, 3, "leaky")
SQUEEZE = "[avgpool]\n" + CONV.format(4, 1, "relu") + "[convolutional]\nfilters=8\nsize=1\nactivation=logistic\n"
BODIES = {
    "grouped": FIRST + CONV.format(12, 3, "leaky").replace("pad=1", "pad=1\ngroups=4\nstride=2"),
    "depthwise": FIRST + CONV.format(8, 3, "linear").replace("pad=1", "pad=1\ngroups=8"),
    **{name: CONV.format(8, 3, name) for name in ("relu", "logistic", "swish", "mish", "linear")},
    "dropout": FIRST + "[dropout]\nprobability=.5\n" + CONV.format(4, 1, "leaky"),
    "halves": FIRST + "[route]\nlayers=-1\ngroups=2\ngroup_id=1\n" + CONV.format(4, 3, "leaky"),
    "two routes": FIRST + CONV.format(4, 3, "leaky") + "[route]\nlayers=-1,-2\n",
    "upsampled": CONV.format(4, 3, "leaky").replace("pad=1", "pad=1\nstride=2") + "[upsample]\nstride=2\n",
    "shortcut": FIRST + CONV.format(8, 3, "leaky") + "[shortcut]\nfrom=-2\nactivation=leaky\n",
    "squeeze": FIRST + SQUEEZE + "[scale_channels]\nfrom=-4\n",
    "spatial": FIRST + CONV.format(8, 3, "logistic") + "[sam]\nfrom=-2\n",
    "pyramid": FIRST
    + "[maxpool]\nstride=1\nsize=5\n[route]\nlayers=-2\n[maxpool]\nstride=1\nsize=9\n[route]\nlayers=-1,-3,-4\n",
    "pooled": FIRST + "[maxpool]\nsize=2\nstride=2\n[maxpool]\nsize=3\nstride=2\npadding=1\n",
}


def with_head(body: str, yolo: str = "", activation: str = "linear") -> str:
    """A network of two classes and two anchors."""
    last = f"[convolutional]\nfilters=14\nsize=1\nactivation={activation}\n"
    head = f"[yolo]\nmask=1,2\nanchors=3,4, 5,9, 12,7\nclasses=2\nnum=3\n{yolo}"
    return f"[net]\nwidth={WIDTH}\nheight={HEIGHT}\nchannels=3\n{body}{last}{head}"


def saved(text: str, folder: Path) -> tuple[Path, Path]:
    files = folder / "n.cfg", folder / "n.weights"
    files[0].write_text(text)
    write_weights(files[1], random_network(text))
    return files


def image_of(width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
    return np.random.default_rng(1).integers(0, 256, (height, width, 3), np.uint8)


def by_opencv(files: tuple[Path, Path], image: np.ndarray, names: list[str] | None = None) -> list[np.ndarray]:
    peer = cv2.dnn.readNetFromDarknet(*map(str, files))
    peer.setInput(cv2.dnn.blobFromImage(image, 1 / 255))
    return list(peer.forward(names or peer.getUnconnectedOutLayersNames()))


def decoded(network: DarknetNetwork, image: np.ndarray, threshold: float) -> tuple[np.ndarray, np.ndarray]:
    """(N, 4) boxes as shares of the image, and their (N, classes) scores."""
    cfg, heads = network.cfg, FusedNetwork(network)(image)
    parts = [
        decode(head, yolo, cfg.width, cfg.height, threshold) for head, yolo in zip(heads, cfg.heads, strict=True)
    ]
    boxes, scores = (np.concatenate(part) for part in zip(*parts, strict=True))
    return boxes / np.tile([cfg.width, cfg.height], 2), scores


def theirs(rows: list[np.ndarray], threshold: float) -> tuple[np.ndarray, np.ndarray]:
    """OpenCV's boxes, of which each has a middle and a size, in the form of :func:`decoded`."""
    found = np.concatenate(rows)
    found = found[found[:, 4] >= threshold]
    middle, half = found[:, :2], found[:, 2:4] / 2
    return np.concatenate([middle - half, middle + half], axis=1), found[:, 5:]


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_a_layer_computes_as_opencvs(body: str, tmp_path: Path) -> None:
    files, image = saved(with_head(body), tmp_path), image_of()
    network = load_network(*files)
    (expected,) = by_opencv(files, image, [f"conv_{len(network.layers) - 2}"])
    with torch.inference_mode():
        (plain,) = network(to_tensor(image[None]))
    (fast,) = FusedNetwork(network)(image)
    assert plain.std() > 0.01
    np.testing.assert_allclose(plain, expected, atol=1e-4)
    np.testing.assert_allclose(fast, expected[0], atol=1e-4)


def test_relu6_is_cut_at_6() -> None:
    """OpenCV's reader does not know it."""
    linear, cut = (random_network(with_head(CONV.format(8, 3, name))).layers[0] for name in ("linear", "relu6"))
    image = 20 * to_tensor(image_of()[None])
    with torch.inference_mode():
        expected = linear(image).clamp(0, 6)
        assert 0.1 < (expected == 6).double().mean() < 0.9
        torch.testing.assert_close(cut(image), expected)


def test_a_dilated_convolution_is_a_larger_one_with_holes(tmp_path: Path) -> None:
    """OpenCV's reader ignores dilation, so it gets the larger kernel."""
    small = CONV.format(8, 3, "leaky").replace("pad=1", "pad=1\ndilation=2")
    dilated = random_network(with_head(FIRST + small))
    large = random_network(with_head(FIRST + CONV.format(8, 5, "leaky")))
    weights = dilated.state_dict()
    kernel = weights["layers.1.conv.weight"]
    weights["layers.1.conv.weight"] = torch.zeros(8, 8, 5, 5)
    weights["layers.1.conv.weight"][:, :, ::2, ::2] = kernel
    large.load_state_dict(weights)
    files = saved(with_head(FIRST + CONV.format(8, 5, "leaky")), tmp_path)
    write_weights(files[1], large)
    (expected,) = by_opencv(files, image_of(), ["conv_2"])
    np.testing.assert_allclose(FusedNetwork(dilated)(image_of())[0], expected[0], atol=1e-4)


@pytest.mark.parametrize(
    ("yolo", "activation"),
    [("", "linear"), ("scale_x_y=1.2\n", "linear"), ("scale_x_y=2\nnew_coords=1\n", "logistic")],
    ids=["plain", "scaled", "new"],
)
def test_boxes_are_opencvs(yolo: str, activation: str, tmp_path: Path) -> None:
    files, threshold = saved(with_head(BODIES["grouped"], yolo, activation), tmp_path), 0.4
    boxes, scores = decoded(load_network(*files), image_of(), threshold)
    expected, their_scores = theirs(by_opencv(files, image_of()), threshold)
    order, their_order = np.lexsort(boxes.T.round(4)), np.lexsort(expected.T.round(4))
    assert 10 < len(boxes) == len(expected)
    np.testing.assert_allclose(boxes[order], expected[their_order], atol=1e-4)
    kept = their_scores[their_order] > 0  # OpenCV clears low scores
    np.testing.assert_allclose(scores[order][kept], their_scores[their_order][kept], atol=1e-4)
    assert kept.any()


def test_stride_is_of_the_coarsest_boxes_even_if_something_is_averaged() -> None:
    assert DarknetNetwork(DarknetCfg.parse(with_head(BODIES["squeeze"]))).stride == 1
    assert DarknetNetwork(DarknetCfg.parse(with_head(BODIES["grouped"]))).stride == 2


@pytest.mark.skipif(not (SHARED / "darknet").exists() or not PHOTOS.exists(), reason="no public networks and photos")
@pytest.mark.parametrize(("name", "kind"), PUBLISHED.items(), ids=PUBLISHED)
def test_public_networks_find_the_people_of_real_photos(name: str, kind: str) -> None:
    """In three photos, what OpenCV finds; and what was written down of it."""
    files = tuple(SHARED / "darknet" / f"{name}.{ending}" for ending in ("cfg", "weights"))
    network, truth = load_network(*files), json.loads((PHOTOS / "truth.json").read_text())["people"]
    for photo in sorted(truth)[:3]:
        rgb = cv2.imread(str(PHOTOS / "people" / photo))[..., ::-1]
        image = cv2.resize(rgb, (network.cfg.width, network.cfg.height))
        found = [
            best(*boxes)
            for boxes in (decoded(network, image, CONFIDENCE), theirs(by_opencv(files, image), CONFIDENCE))
        ]
        np.testing.assert_allclose(*found, atol=1e-3)
        written = np.array(truth[photo][kind])[:, :4] / np.tile(rgb.shape[1::-1], 2)
        written[:, 2:] += written[:, :2]
        assert (overlaps(written, found[0]).max(axis=1) > 0.6).mean() > 0.9


def best(boxes: np.ndarray, scores: np.ndarray) -> np.ndarray:
    """The boxes, one for each person; a person is the first class."""
    sure = scores[:, 0] >= CONFIDENCE
    boxes, scores = boxes[sure], scores[sure, 0]
    return boxes[suppress(boxes, scores, 0.45, 3000)]
