import numpy as np
import pytest

from pipeline.exploration import visibility_kernels as kernels
from pipeline.exploration.view_areas import ViewAreas

SIGHT = kernels.Sight(0.6, 0.17, 0.9, 3.1, -0.6, 0.15, 0.15, 1.0)
RAYS, STRIDE, SHAPE = 24, 5, (203, 101)


def ground_with(known: np.ndarray, origin: tuple[float, float] = (0.0, 0.0)) -> kernels.Ground:
    elevation = np.where(known, 0.0, np.nan).astype(np.float32)
    return kernels.Ground(
        np.array(origin),
        0.05,
        elevation,
        np.zeros((*SHAPE, 2), np.float32),
        ~known,
        np.ones(SHAPE, np.float32),
        np.full((*SHAPE, 2), np.inf, np.float32),
        0.35,
    )


def known_up_to(i: int) -> np.ndarray:
    known = np.zeros(SHAPE, np.bool_)
    known[:i] = True
    return known


CELLS = np.argwhere(np.ones((20, 20), np.bool_)) * STRIDE


def fresh(cells: np.ndarray, ground: kernels.Ground) -> np.ndarray:
    return kernels.ray_areas(ground.origin + (cells + 0.5) * ground.cell, RAYS, SIGHT, ground)


@pytest.fixture
def casts(monkeypatch):
    """How many places rays were cast from, call by call."""
    numbers, cast = [], kernels.ray_areas

    def counted(places, *rest):
        numbers.append(len(places))
        return cast(places, *rest)

    monkeypatch.setattr(kernels, "ray_areas", counted)
    return numbers


def test_what_is_kept_is_what_a_fresh_cast_tells():
    areas, rng = ViewAreas(RAYS, STRIDE, SIGHT), np.random.default_rng(0)
    known = known_up_to(60)
    for _ in range(6):
        i, j = rng.integers(0, SHAPE[0] - 20), rng.integers(0, SHAPE[1] - 20)
        known[i : i + 20, j : j + 20] = rng.random() < 0.7
        some = CELLS[rng.random(len(CELLS)) < 0.8]
        ground = ground_with(known.copy())
        np.testing.assert_array_equal(areas.of(some, ground), fresh(some, ground))


def test_unchanged_ground_costs_nothing(casts):
    areas = ViewAreas(RAYS, STRIDE, SIGHT)
    for _ in range(2):
        areas.of(CELLS, ground_with(known_up_to(60)))
    assert casts == [len(CELLS), 0]


def test_a_change_concerns_only_what_sees_it(casts):
    areas, known = ViewAreas(RAYS, STRIDE, SIGHT), known_up_to(200)
    areas.of(CELLS, ground_with(known))
    changed = known.copy()
    changed[0, 0] = False
    areas.of(CELLS, ground_with(changed))
    assert 0 < casts[1] < len(CELLS)


def test_a_grown_grid_is_looked_at_anew(casts):
    areas = ViewAreas(RAYS, STRIDE, SIGHT)
    areas.of(CELLS, ground_with(known_up_to(60)))
    areas.of(CELLS, ground_with(known_up_to(60), origin=(-6.4, 0.0)))
    assert casts == [len(CELLS)] * 2
