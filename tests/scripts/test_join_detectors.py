"""Two networks joined into one see what each saw of people."""

import numpy as np
import pytest
import torch

from pipeline.victims.detection.darknet_cfg import DarknetCfg
from pipeline.victims.detection.inference import to_tensor
from pipeline.victims.detection.network import DarknetNetwork
from scripts.assets.join_detectors import join
from tests.pipeline.victims.detection.networks import SMALL, random_network

COPY = "[convolutional]\nfilters=3\nsize=1\nactivation=linear\n"
VOC = SMALL.replace("classes=1", "classes=20").replace("filters=6", "filters=25")
COCO = SMALL.replace("classes=1", "classes=80").replace("filters=6", "filters=85")
BODY = SMALL[SMALL.index("[convolutional]") :]
TWICE = BODY.replace("filters=6", "filters=12").replace("mask=0\nanchors=4,6", "mask=0,1\nanchors=4,6, 4,6")
TWICE = TWICE.replace("num=1", "num=2")
PERSON, PERSON_OF_VOC, TEDDY_BEAR = 5, 5 + 14, 5 + 77


@pytest.mark.parametrize(
    ("other", "body", "kept"),
    [(VOC, BODY, [0, 1, 2, 3, 4, PERSON_OF_VOC]), (COCO, TWICE, [0, 1, 2, 3, 4, PERSON, 0, 1, 2, 3, 4, TEDDY_BEAR])],
)
def test_each_part_sees_the_image_and_finds_people_and_what_looks_like_a_doll(
    other: str, body: str, kept: list[int]
) -> None:
    head = SMALL[: SMALL.index("[convolutional]")]
    joined = DarknetNetwork(DarknetCfg.parse(f"{head}{COPY}{body}[route]\nlayers=0\n{BODY}")).eval()
    parts = [random_network(other, 1), random_network(SMALL, 2)]
    join(joined, parts)
    image = to_tensor(np.random.default_rng(0).integers(0, 256, (1, 8, 16, 3), np.uint8))
    with torch.inference_mode():
        first, second = joined(image)
        ((many,), (one,)) = (part(image) for part in parts)
    torch.testing.assert_close(first, many[:, kept])
    torch.testing.assert_close(second, one)
