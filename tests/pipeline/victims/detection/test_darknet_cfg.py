"""Darknet's .cfg: what is read, and what is refused by its line."""

from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.errors import InputError
from pipeline.victims.detection.darknet_cfg import (
    Convolutional,
    DarknetCfg,
    Maxpool,
    RouteLayer,
    Shortcut,
    YoloHead,
    adapted,
)
from tests.pipeline.victims.detection.networks import FULL, OWN, SMALL, TINY


def test_a_text_is_read() -> None:
    cfg = DarknetCfg.parse("# a comment\n; another\n" + SMALL.replace("size=1", " size = 1 # so"))
    assert (cfg.width, cfg.height, cfg.channels, cfg.classes) == (16, 8, 3, 1)
    assert cfg.layers[0] == Convolutional(2, 3, 2, 1, True, "leaky")
    assert cfg.layers[1] == Convolutional(6, 1, 1, 0, False, "linear")
    assert cfg.heads == [YoloHead(((4, 6),), (0,), 1)]


def test_layers_are_counted_from_here_and_from_the_start() -> None:
    layers = DarknetCfg.parse(TINY).layers
    assert layers[17] == RouteLayer((13,))  # -4
    assert layers[20] == RouteLayer((19, 8))  # -1, 8
    assert layers[11] == Maxpool(2, 1, 1)
    assert DarknetCfg.parse(FULL).layers[4] == Shortcut(1)


def test_the_published_networks_have_as_many_layers_as_published() -> None:
    assert len(DarknetCfg.parse(TINY).layers) == 24
    full = DarknetCfg.parse(FULL)
    assert len(full.layers) == 107
    assert [i for i, layer in enumerate(full.layers) if isinstance(layer, YoloHead)] == [82, 94, 106]
    assert full.heads[0].mask == (6, 7, 8)
    assert full.heads[0].anchors[0] == (10, 13)  # as fitted to COCO in arXiv:1804.02767
    assert full.heads[0].anchors[-1] == (373, 326)


@pytest.mark.parametrize("text", [TINY, FULL, OWN], ids=["tiny", "full", "own"])
def test_a_network_is_adapted_to_another_input_and_other_classes(text: str) -> None:
    before = DarknetCfg.parse(text)
    assert adapted(text, before.width, before.height, before.classes, before.heads[0].anchors) == text
    anchors = tuple((float(k), 2.5 * k) for k in range(1, 1 + len(before.heads[0].anchors)))
    after = DarknetCfg.parse(adapted(text, 64, 96, 3, anchors))
    assert (after.width, after.height, after.channels) == (64, 96, 3)
    assert after.heads == [YoloHead(anchors, head.mask, 3) for head in before.heads]
    for old, new, following in zip(before.layers, after.layers, (*before.layers[1:], None), strict=True):
        if isinstance(following, YoloHead):
            assert new == replace(old, filters=24)
        elif not isinstance(old, YoloHead):
            assert new == old


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[net]", "[crnn]", "begins with"),
        ("[yolo]", "[region]", r"net.cfg:19: \[region\] unknown section"),
        ("width=16", "width=16.5", r"net.cfg:1: \[net\] width=16.5: not a whole number"),
        ("height=8", "", "height is missing"),
        ("height=8", "height=0", "at least 1"),
        ("stride=2", "stride", "net.cfg:10: neither"),
        ("activation=leaky", "activation=selu", "activation=selu: known are linear, leaky"),
        ("filters=6", "filters=6\ngroups=4", r"net.cfg:14: \[convolutional\] groups=4: do not divide its 6 filters"),
        ("stride=2", "stride=2\nstride_x=1", "stride_x=1: known are 2"),
        ("filters=2", "filters=2\ndilation=65", "dilation=65: one number, at least 1 and at most 64"),
        ("[yolo]", "[local_avgpool]\n[yolo]", r"\[local_avgpool\] unknown section; known are \[convolutional\]"),
        ("[yolo]", "[route]\nlayers=-1\ngroups=2\ngroup_id=2\n[yolo]", "group_id=2: one number, at least 0"),
        ("[yolo]", "[scale_channels]\nfrom=0\nscale_wh=1\n[yolo]", "scale_wh=1: known are 0"),
        ("num=1", "num=1\nscale_x_y=-1", "scale_x_y=-1: one positive number"),
        ("num=1", "num=1\nnew_coords=2", "new_coords=2: known are 0, 1"),
        ("num=1", "num=1\nwitnesses=1", r"net.cfg: witnesses: layer 1 is no \[yolo\]"),
        ("num=1", "num=1\nwitnesses=2", "layer 2: there is no such layer before it"),
        ("batch_normalize=1", "batch_normalize=2", "batch_normalize=2"),
        ("anchors=4,6", "anchors=4,6,8", "anchors"),
        ("anchors=4,6", "anchors=4,-6", "positive"),
        ("mask=0", "mask=1", "mask"),
        ("mask=0", "mask=" + 50_000 * "0,", "mask"),
        ("anchors=4,6", "anchors=nan,6", "positive"),
        ("anchors=4,6", "anchors=inf,6", "positive"),
        ("width=16", "width=65536", "width=65536: one number, at least 1 and at most 65535"),
        ("width=16", "width=" + 5000 * "9", "not a whole number"),
        ("size=3", "size=65", "size=65: one number, at least 1 and at most 64"),
        ("stride=2", "stride=99999", "stride=99999"),
        ("[yolo]", "[maxpool]\nsize=2\npadding=1000000\n[yolo]", "padding=1000000"),
        ("[yolo]", "[upsample]\nstride=100000\n[yolo]", "stride=100000"),
        ("[yolo]", "[route]\nlayers=2\n[yolo]", "layer 2: there is no such layer"),
        ("[yolo]", "[shortcut]\nfrom=0,1\nactivation=linear\n[yolo]", "one layer, not 2"),
    ],
)
def test_what_is_wrong_is_said(old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        DarknetCfg.parse(SMALL.strip().replace(old, new), "net.cfg")


def test_a_network_without_boxes_is_none() -> None:
    with pytest.raises(InputError, match=r"no \[yolo\]"):
        DarknetCfg.parse(SMALL.split("[yolo]")[0])
    with pytest.raises(InputError, match="classes"):
        DarknetCfg.parse(SMALL + "[yolo]\nmask=0\nanchors=4,6\nclasses=2\nnum=1\n")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        DarknetCfg.read(tmp_path / "none.cfg")
    (tmp_path / "binary.cfg").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not a text"):
        DarknetCfg.read(tmp_path / "binary.cfg")
