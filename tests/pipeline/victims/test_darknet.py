"""Networks of Darknet: of every kind of layer, published ones, and files that are broken."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.victims.boxes import pairwise_iou
from pipeline.victims.detector import VictimDetector
from tests.pipeline.victims.networks import HEADER, SMALL, darknet_files, small_numbers

SHARED = Path(__file__).parents[4] / "shared"
PUBLISHED = {"yolo-fastest-1.1-xl": "coco_person", "yolo-fastest-1.1_body": "body"}
"""Networks by their names, and what their boxes are called in the photos' truth."""
CONV = "[convolutional]\nfilters={}\nsize={}\npad=1\nbatch_normalize=1\nactivation={}\n"
FIRST, COUNT = CONV.format(8, 3, "leaky"), 32 + 8 * 27
"""The first layer of networks, and its number of weights."""
LAST = "[convolutional]\nfilters=6\nsize=1\nactivation=linear\n[yolo]\nmask=0\nanchors=4,6\nclasses=1\nnum=1\n"
NET = "[net]\nwidth=16\nheight=8\nchannels=3\n"
LAYERS = {
    "grouped": (CONV.format(12, 3, "leaky") + "groups=4\nstride=2\n", 48 + 12 * 18, 12),
    "fewer channels": (CONV.format(4, 3, "leaky") + "[shortcut]\nfrom=-2\n", 16 + 4 * 72, 4),
    "more channels": (CONV.format(12, 3, "swish") + "[shortcut]\nfrom=-2\nactivation=linear\n", 48 + 12 * 72, 12),
    "maxpool of its stride": ("[maxpool]\nstride=2\n", 0, 8),
    "maxpool of stride 1": ("[maxpool]\nsize=3\n", 0, 8),
    "halves": ("[route]\nlayers=-1\ngroups=2\ngroup_id=1\n", 0, 4),
    "upsampled": ("[upsample]\n", 0, 8),
    "dropout": ("[dropout]\nprobability=.5\n", 0, 8),
    "joined": (CONV.format(4, 3, "mish") + "[route]\nlayers = -1, -2\n", 16 + 4 * 72, 12),
    "comments": ("# a comment = of [yolo]\n; another\nfoo=bar # witnesses=3\n", 0, 8),
}
"""Between the first layer and the last: text, number of weights, channels."""


@pytest.mark.usefixtures("unisolated")
@pytest.mark.parametrize("name", LAYERS)
def test_layers_are_run(name: str, tmp_path: Path) -> None:
    body, count, channels = LAYERS[name]
    numbers = np.random.default_rng(0).uniform(0, 0.3, COUNT + count + 6 + 6 * channels)
    detector = VictimDetector.load(*darknet_files(tmp_path, NET + FIRST + body + LAST, numbers))
    assert detector.detect(np.full((8, 16, 3), 200, np.uint8))


@pytest.mark.usefixtures("unisolated")
def test_layers_after_the_last_head_do_not_matter(tmp_path: Path) -> None:
    numbers = np.concatenate([small_numbers(), np.zeros(7 * 3)])
    text = SMALL + "[route]\nlayers=1\n[convolutional]\nfilters=3\nactivation=linear\n"
    image = np.full((8, 16, 3), 200, np.uint8)
    found = [VictimDetector.load(*files).detect(image) for files in (darknet_files(tmp_path, text, numbers),)]
    assert found == [VictimDetector.load(*darknet_files(tmp_path)).detect(image)]


@pytest.mark.usefixtures("unisolated")
def test_defaults_are_those_of_darknet(tmp_path: Path) -> None:
    """OpenCV pools with a stride of 2, and upsamples by 1, where nothing is said."""
    image = np.random.default_rng(1).integers(0, 256, (8, 16, 3), np.uint8)
    numbers = np.random.default_rng(0).uniform(0, 0.3, COUNT + 6 + 48)
    for short, full in (
        ("[maxpool]\nsize=2\n", "stride=1\n"),
        ("[maxpool]\n", "size=1\nstride=1\n"),
        ("[upsample]\n", "stride=2\n"),
    ):
        texts = (NET + FIRST + short + LAST, NET + FIRST + short + full + LAST)
        found = [VictimDetector.load(*darknet_files(tmp_path, text, numbers)).detect(image) for text in texts]
        assert found[0] == found[1]


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_networks_find_what_their_makers_found(name: str) -> None:
    cfg, photos = SHARED / "darknet" / f"{name}.cfg", SHARED / "real_photos"
    if not cfg.exists():
        pytest.skip("no published networks here")
    detector = VictimDetector.load(cfg, cfg.parent / f"{name}.weights")
    truth = json.loads((photos / "truth.json").read_text())["people"]
    found = wanted = 0
    for photo, boxes in sorted(truth.items())[:8]:
        rgb = cv2.cvtColor(cv2.imread(str(photos / "people" / photo)), cv2.COLOR_BGR2RGB)
        ours = np.array([d.box for d in detector.detect(rgb)]).reshape(-1, 4)
        theirs = np.array(
            [(x, y, x + w, y + h) for x, y, w, h, sure in boxes.get(PUBLISHED[name], ()) if sure >= 0.6]
        )
        wanted += len(theirs)
        found += int((pairwise_iou(theirs.reshape(-1, 4), ours).max(axis=1, initial=0) > 0.5).sum())
    assert wanted > 5
    assert found >= 0.9 * wanted


@pytest.mark.usefixtures("unisolated")
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[yolo]", "[gru]", r"n\.cfg: .*no \[yolo\]"),
        ("activation=linear", "activation=linear\n[gru]", "gru"),
        ("stride=2", "stride=0", "OpenCV"),
        ("stride=2", "stride=x", r"n\.cfg:7: \[convolutional\] stride=x"),
        ("stride=2", "stride=2\ndilation=2", "dilation=2"),
        ("stride=2", "stride=2\nstride_x=1", "stride_x=1"),
        ("groups", "groups", "too long"),
        ("filters=2", "filters=3", "too short"),
        ("filters=6", "filters=12", "OpenCV"),
        ("filters=2", "filters=65535\ngroups=7", "OpenCV"),
        ("width=16\nheight=8", "width=60000\nheight=60000", "OpenCV|too large"),
        ("width=16\nheight=8", "width=30000\nheight=20000", "OpenCV|too large"),
        ("filters=2", "filters=900000000", "OpenCV"),
        ("mask=0", "mask=1", "mask=1"),
        ("mask=0", "mask=0.5", "mask=0.5"),
        ("mask=0", "mask=", "mask="),
        ("anchors=4,6", "anchors=a,6", "anchors=a,6"),
        ("num=1", "num=2", "OpenCV"),
        ("channels=3", "channels=4", "channels=4: must be 3"),
        ("[net]", "stuff", r"n\.cfg:2: .*stuff"),
        ("width=16", "", "width"),
        ("activation=linear", "activation=linear\n[route]\nlayers=9", "OpenCV"),
    ],
)
def test_a_cfg_that_cannot_be_run_is_refused(old: str, new: str, message: str, tmp_path: Path) -> None:
    extra = np.zeros(1) if old == new else np.zeros(0)
    files = darknet_files(tmp_path, SMALL.replace(old, new), np.concatenate([small_numbers(), extra]))
    with pytest.raises(InputError, match=message) as raised:
        VictimDetector.load(*files)
    assert "\n" not in str(raised.value)


@pytest.mark.usefixtures("unisolated")
@pytest.mark.parametrize(
    "content",
    [b"", HEADER[:9], b"\0" * 300, b"\0" * 3000, b"PK\3\4" * 99, HEADER + b"\0" * 3, HEADER + b"\xff" * 352],
)
def test_weights_that_are_none_are_refused(content: bytes, tmp_path: Path) -> None:
    files = darknet_files(tmp_path)
    files[1].write_bytes(content)
    with pytest.raises(InputError, match=r"n\.weights"):
        VictimDetector.load(*files)


@pytest.mark.parametrize(("place", "number"), [(0, np.nan), (6, -1.0), (20, np.inf)])
def test_numbers_that_are_impossible_are_refused(place: int, number: float, tmp_path: Path) -> None:
    numbers = small_numbers()
    numbers[place] = number
    with pytest.raises(InputError, match="not finite"):
        VictimDetector.load(*darknet_files(tmp_path, SMALL, numbers))


def test_weights_of_another_hash_are_refused(tmp_path: Path) -> None:
    files = darknet_files(tmp_path)
    files[1].with_name("n.weights.sha256").write_text("0" * 64 + "  n.weights\n")
    with pytest.raises(InputError, match="SHA-256"):
        VictimDetector.load(*files)
