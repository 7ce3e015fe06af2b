import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from sarsim.arenas.things.codes import QUIET_ZONE, TAG_DICTIONARY, qr_modules, qr_picture, tag_picture


@pytest.mark.parametrize("text", ["7", "wall 3", "https://example.org/a?b=c&d=<e>", "ünïcode ✓", "x" * 300])
def test_a_code_says_its_text(text):
    picture = qr_picture(text)
    assert cv2.QRCodeDetector().detectAndDecode(picture)[0] == text


def test_a_code_has_a_quiet_zone_and_square_modules():
    modules, picture = qr_modules("wall 3"), qr_picture("wall 3")
    assert len(modules) % 4 == 1 and len(modules) >= 21 and set(np.unique(modules)) == {0, 255}
    assert (modules[:7, 0] == 0).all() and (modules[0, :7] == 0).all() and (modules[-7:, 0] == 0).all()
    assert_array_equal(picture[4::8, 4::8], np.pad(modules, QUIET_ZONE, constant_values=255))


def test_a_tag_is_read_as_its_number():
    for number in (0, 50, 586):
        picture = np.pad(tag_picture(number), 20, constant_values=128)
        _, ids, _ = cv2.aruco.ArucoDetector(TAG_DICTIONARY).detectMarkers(picture)
        assert ids.item() == number
