"""COCO exports, as pycocotools reads them."""

from pathlib import Path

import numpy as np
import pytest
from pycocotools import mask as coco_masks
from pycocotools.coco import COCO

from pipeline.labels import Label
from sarsim.dataset.exports.images import Coco, object_masks, run_lengths
from sarsim.dataset.manifest import Dataset
from tests.sarsim.dataset.small import toys


@pytest.mark.parametrize("seed", range(8))
def test_run_lengths_are_pycocotools_own(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = rng.integers(1, 90, 2)
    # From single pixels to runs of thousands.
    mask = rng.random(shape) < rng.choice([0.01, 0.5, 0.99])
    mask = np.repeat(mask, rng.choice([1, 40]), axis=0)
    mask[rng.integers(len(mask)), 0] = True
    theirs = coco_masks.encode(np.asfortranarray(mask, np.uint8))["counts"].decode()
    assert run_lengths(mask) == theirs


def test_pycocotools_reads_the_true_masks_and_boxes_and_none_of_what_shows_little(tmp_path: Path) -> None:
    toys(tmp_path / "data", 5)
    list(Coco(tmp_path / "data", tmp_path / "out", min_area=1).run())
    assert {path.stem for path in (tmp_path / "out" / "annotations").iterdir()} == {"train", "val"}
    known = COCO(str(tmp_path / "out" / "annotations" / "train.json"))
    assert {c["name"] for c in known.loadCats(known.getCatIds())} == {k.name.lower() for k in Label if k}
    scenes = (scene for entry, scene in Dataset(tmp_path / "data") if entry.split == "train")
    images = iter(sorted(known.imgs))
    count = 0
    for scene in scenes:
        for frame in scene:
            image = next(images)
            assert (tmp_path / "out" / "images" / "train" / known.imgs[image]["file_name"]).exists()
            assert frame.instance is not None and frame.label is not None
            found = known.loadAnns(known.getAnnIds(imgIds=[image]))
            for row, (label, mask) in zip(found, object_masks(frame.instance, scene.content, 1), strict=True):
                count += 1
                assert row["category_id"] == label
                np.testing.assert_array_equal(known.annToMask(row), mask)
                assert row["area"] == mask.sum()
                assert row["bbox"] == coco_masks.toBbox(known.annToRLE(row)).tolist()
                assert (frame.label[mask] == label).all()
    assert count > 10
    list(Coco(tmp_path / "data", tmp_path / "large", min_area=12).run())
    known = COCO(str(tmp_path / "large" / "annotations" / "train.json"))
    assert known.anns and all(row["area"] >= 12 for row in known.anns.values())
