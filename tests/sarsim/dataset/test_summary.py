"""The page of a dataset."""

import base64
import re
from html.parser import HTMLParser
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest

from pipeline.labels import COLOURS, Label
from sarsim.dataset.summary import depth_picture, with_boxes, write_summary
from tests.sarsim.dataset.small import toys


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("toys")
    toys(folder, 14)
    write_summary(folder)
    return (folder / "index.html").read_text()


def test_every_tag_is_known_to_a_parser(page: str) -> None:
    seen: dict[str, int] = {}

    class Counter(HTMLParser):
        def handle_starttag(self, tag: str, attrs: object) -> None:
            seen[tag] = seen.get(tag, 0) + 1

    Counter().feed(page)
    assert seen["rect"] == len(Label)
    assert seen["figure"] == 7  # of 14 scenes, 12 at most
    assert seen["img"] == 3 * 7  # in the page itself
    assert "http" not in page and "href" not in page
    for data in re.findall(r'base64,([^"]+)"', page):
        picture = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR)
        assert picture.shape == (240, 320, 3)


def test_the_balance_adds_up(page: str) -> None:
    svg = ElementTree.fromstring(re.search(r"<svg.*</svg>", page, re.DOTALL)[0])
    widths = [float(rect.get("width")) for rect in svg]
    assert sum(widths) == pytest.approx(1000, abs=1)
    walls, floors = 14 * 5, sum(7 + k for k in range(14))
    assert widths[Label.WALL] == pytest.approx(1000 * walls / (walls + floors), abs=0.1)
    assert f">{walls}<" in page and f">{floors}<" in page


def test_pictures_box_victims_and_leave_missing_depth_black() -> None:
    boxed = with_boxes(np.full((6, 8, 3), 90, np.uint8), np.array([[1, 2, 5, 6]], np.int32))
    frame = np.zeros((6, 8), np.bool_)
    frame[2:6, 1:5], frame[3:5, 2:4] = True, False
    np.testing.assert_array_equal((boxed == COLOURS[Label.VICTIM]).all(axis=2), frame)
    missing, near, far = depth_picture(np.array([[0, 0.8, 3.5]], np.float32))[0].astype(int)
    assert not missing.any() and near[2] > near[0] and far[0] > far[2]
