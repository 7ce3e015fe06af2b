"""How well the depth returns of a detection agree with what it claims to be."""

import numpy as np
import pytest

from pipeline.plugins.finds.config import FindsConfig
from pipeline.tracks.likelihood import extents_of, relative_positions, weigh
from pipeline.victims.people import PeoplePolicy

EXTENTS = {
    "victim": (0.45, 0.2, 0.14),
    "hazmat_sign": (0.2, 0.2, 0.02),
    "fire_extinguisher": (0.45, 0.16, 0.14),
    "door_lever": (0.22, 0.14, 0.06),
}
"""m, of a doll and of the other kinds, the longest first."""
FORMS = {"victim": PeoplePolicy().extents, **{kind: numbers.extents for kind, numbers in FindsConfig().kinds.items()}}


def block(extents: tuple[float, float, float], middle: tuple[float, float, float], count: int = 3000) -> np.ndarray:
    """(N, 3) returns spread over a block of x, y, z extents, m, so that the middle 90% measure them."""
    spread = np.random.default_rng(0).uniform(-0.5, 0.5, (count, 3)) / 0.9
    return spread * extents + middle


def ratio(kind: str, extents: tuple[float, float, float], z: float = 0.4, **other) -> float:
    return weigh(FORMS[kind], block(extents, (2.0, 0.0, z)), 0.0, **other).log_ratio


def test_extents_are_measured_along_an_objects_own_axes() -> None:
    c, s = np.cos(0.5), np.sin(0.5)
    turned = block((0.3, 1.6, 0.5), (0, 0, 0)) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T
    np.testing.assert_allclose(extents_of(turned), [1.6, 0.5, 0.3], atol=0.02)


@pytest.mark.parametrize(
    "extents", [(0.3, 0.5, 1.7), (1.6, 0.5, 0.25), (0.65, 0.6, 1.2), (0.6, 0.5, 0.9), (0.4, 0.15, 0.12)]
)
def test_people_standing_lying_and_sitting_and_dolls_are_likely(extents: tuple[float, float, float]) -> None:
    assert ratio("victim", extents, extents[2] / 2) > 0


@pytest.mark.parametrize(
    "extents", [(2.0, 1.9, 1.6), (0.02, 3.0, 2.0), (2.0, 1.2, 0.02), (0.03, 0.03, 0.03)], ids=str
)
def test_furniture_walls_tables_and_pebbles_are_no_people(extents: tuple[float, float, float]) -> None:
    assert ratio("victim", extents, max(0.2, extents[2] / 2)) < 0


@pytest.mark.parametrize("kind", EXTENTS)
def test_each_kind_is_likeliest_at_its_own_size(kind: str) -> None:
    longest, middle, shortest = EXTENTS[kind]
    own = ratio(kind, (shortest, middle, longest))
    assert own > 0
    assert own > ratio(kind, (3 * shortest, 3 * middle, 3 * longest))
    assert own > ratio(kind, (shortest / 9, middle / 9, longest / 9))


def test_nothing_hangs_in_the_sky() -> None:
    low, high = (ratio("hazmat_sign", (0.02, 0.2, 0.2), z) for z in (1.0, 4.0))
    assert low > 0 > high
    raised = weigh(FORMS["hazmat_sign"], block((0.02, 0.2, 0.2), (2, 0, 4)), 3.0)
    assert raised.log_ratio == pytest.approx(low, abs=1e-9)


def test_only_the_part_that_fits_belongs() -> None:
    person, bar = block((0.3, 0.5, 1.7), (2.0, 0.0, 0.9)), block((0.02, 0.05, 0.05), (3.5, 0.1, 0.9), 300)
    wall = block((0.01, 2.0, 2.0), (4.0, 0.0, 1.0), 900)
    points = np.concatenate([person, bar, wall])
    is_wall = np.arange(len(points)) >= len(person) + len(bar)
    weighed = weigh(FORMS["victim"], points, 0.0, is_wall)
    np.testing.assert_array_equal(weighed.belongs, np.arange(len(points)) < len(person))


def test_an_object_spans_the_box_that_was_drawn_around_it() -> None:
    doll, in_box = block((0.12, 0.2, 0.4), (2.0, 0.0, 0.3)), np.random.default_rng(1).uniform(0, 1, (3000, 2))
    whole, ninth = (weigh(FORMS["victim"], doll, 0.0, in_box=in_box * side).log_ratio for side in (1.0, 1 / 3))
    assert whole > 0 > ninth
    assert whole - ninth == pytest.approx(3 * np.log(9))


def test_an_object_has_most_of_the_returns_in_its_box() -> None:
    doll, around = block((0.12, 0.2, 0.4), (2.0, 0.0, 0.3)), block((0.01, 2.0, 2.0), (4.0, 0.0, 0.3), 3000)
    in_box = np.random.default_rng(1).uniform(0, 1, (6000, 2))
    alone = weigh(FORMS["victim"], doll, 0.0, in_box=in_box[:3000]).log_ratio
    both = weigh(FORMS["victim"], np.concatenate([doll, around]), 0.0, np.arange(6000) >= 3000, in_box).log_ratio
    assert alone - both == pytest.approx(np.log(2))


def test_places_are_measured_in_the_whole_box() -> None:
    box, returns = np.zeros((6, 9), bool), np.zeros((6, 9), bool)
    box[1:6, 2:5] = True
    returns[[1, 3], [2, 3]] = True
    np.testing.assert_array_equal(relative_positions(returns, box), [(0, 0), (0.5, 0.5)])


def test_without_returns_nothing_is_likely() -> None:
    points = block((0.3, 0.5, 1.7), (2, 0, 0.9))
    all_of_it, in_box = np.ones(len(points), bool), np.zeros((len(points), 2))
    for weighed in (weigh(FORMS["victim"], points[:0], 0.0), weigh(FORMS["victim"], points, 0.0, all_of_it, in_box)):
        assert weighed.log_ratio == -np.inf
        assert not weighed.belongs.any()
    assert np.isfinite(weigh(FORMS["victim"], points[:1], 0.0, in_box=in_box[:1]).log_ratio)
