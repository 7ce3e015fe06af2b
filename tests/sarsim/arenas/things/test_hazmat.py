"""Signs: every class is drawn, and looks like itself alone."""

from itertools import combinations, product

import numpy as np
import pytest

from pipeline.tracks.find import HAZMAT_CLASSES
from sarsim.arenas.things.hazmat import SignStyle, sign_face

SIZE = 96


@pytest.fixture(scope="module")
def faces():
    return {name: sign_face(name, SIZE).astype(float) for name in HAZMAT_CLASSES}


def test_no_two_classes_look_alike(faces):
    """The nearest two, a gas and a liquid that burn, differ by a word and a digit: in 2% of the pixels at least."""
    for a, b in combinations(HAZMAT_CLASSES, 2):
        differs = np.abs(faces[a] - faces[b]).max(axis=2) > 100
        assert differs.mean() > 0.02, (a, b)


def test_a_face_has_the_top_of_the_sign_in_its_top_left_corner():
    above, below, bare = (
        np.s_[8:12, 8:12],
        np.s_[-30:-14, -30:-14],
        SignStyle(has_words=False, has_number=False, size=0.5),
    )
    for name, top, bottom in (
        ("corrosive", (255, 255, 255), (0, 0, 0)),
        ("organic-peroxide", (218, 41, 28), (255, 221, 0)),
        ("spontaneously-combustible", (255, 255, 255), (218, 41, 28)),
    ):
        for where, colour in ((above, top), (below, bottom)):
            assert np.abs(np.median(sign_face(name, SIZE, bare)[where], axis=(0, 1)) - colour).max() <= 3, name


def test_a_style_draws_the_same_twice_and_styles_differ():
    rng = np.random.default_rng(0)
    styles = [SignStyle.random(rng) for _ in range(8)]
    for style in styles:
        np.testing.assert_array_equal(sign_face("explosive", SIZE, style), sign_face("explosive", SIZE, style))
    assert len({sign_face("explosive", SIZE, style).tobytes() for style in styles}) == len(styles)


def test_every_class_is_drawn_in_every_variant():
    rng = np.random.default_rng(1)
    for name, variant in product(HAZMAT_CLASSES, range(4)):
        face = sign_face(name, SIZE, SignStyle(variant=variant, tint=(0.9, 0.9, 0.9)))
        assert face.shape == (SIZE, SIZE, 3) and face.dtype == np.uint8 and face.max() <= 230
        assert sign_face(name, SIZE, SignStyle.random(rng)).std() > 20
