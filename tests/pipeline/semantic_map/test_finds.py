"""What was found, in small labelled maps by hand."""

import numpy as np
import pytest

from pipeline.labels import Label
from pipeline.semantic_map.finds import with_finds

STEP, EDGE, SKIN = 0.04, 0.02, 0.03
BOX = (0.5, 0.24, 0.4)  # m, along x, y and z


def cloud(*points: tuple[float, float, float]) -> np.ndarray:
    return np.array(points, np.float32).reshape(-1, 3)


def plane(corner: tuple[float, float, float], along: tuple[float, float, float]) -> np.ndarray:
    """Points of a level or upright rectangle, every EDGE m; one of its sides is 0."""
    axes = [c + np.arange(0, max(side, EDGE / 2), EDGE) for c, side in zip(corner, along, strict=True)]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3).astype(np.float32)


def doll(z: float) -> np.ndarray:
    """A person that lies in the box whose lowest point is at a height."""
    return plane((-0.2, -0.2, z + 0.02), (0.4, 0.1, 0))


def box_on_wall(z: float) -> tuple[np.ndarray, np.ndarray]:
    """Points and labels of a wall at y = 0, a floor, and a box with a doll that hangs at a height."""
    x, y, h = BOX
    sides = [plane((at, -y, z), (0, y - 0.01, h)) for at in (-x / 2, x / 2)]
    ends = [plane((-x / 2, -y, at), (x, y - 0.01, 0)) for at in (z, z + h)]
    parts = [
        (Label.WALL, plane((-1, 0, 0), (2, 0, 1.2))),
        (Label.TERRAIN, plane((-1, -1, 0), (2, 1, 0))),
        *((Label.CLUTTER, part) for part in (*sides, *ends, doll(z))),
    ]
    labels = np.concatenate([np.full(len(part), label, np.uint8) for label, part in parts])
    return np.concatenate([part for _, part in parts]), labels


def behind(points: np.ndarray, z: float) -> np.ndarray:
    """Which points are the wall's in the middle of the box."""
    x, _, h = BOX
    is_in = (np.abs(points[:, 0]) < x / 2 - 0.01) & (points[:, 2] > z + 0.01) & (points[:, 2] < z + h - 0.01)
    return is_in & (points[:, 1] == 0)


def test_what_lies_at_the_points_of_a_find_is_of_its_label() -> None:
    points = cloud((0.01, 0.01, 0.01), (0.07, 0.01, 0.01), (2, 0, 0))
    labels = np.array([Label.WALL, Label.TERRAIN, Label.INCLINED_RAMP], np.uint8)
    signs = [cloud((0.01, 0.02, 0.01), (0.0, 0.0, 0.3)), cloud((2, 0, 0)), cloud()]
    found = with_finds(points, labels, signs, [cloud((2, 0, 0.02))], STEP, SKIN)
    assert found.tolist() == [Label.CLUTTER, Label.TERRAIN, Label.VICTIM]
    assert labels.tolist() == [Label.WALL, Label.TERRAIN, Label.INCLINED_RAMP]
    assert with_finds(points, labels, [], [cloud((5, 5, 5))], STEP, SKIN).tolist() == labels.tolist()


def test_a_classifier_that_knows_victims_has_the_say() -> None:
    points, labels = cloud((0, 0, 0), (2, 0, 0)), np.array([Label.WALL, Label.VICTIM], np.uint8)
    assert with_finds(points, labels, [points[:1]], [points[:1]], STEP, SKIN).tolist() == labels.tolist()


def test_the_wall_in_a_box_that_hangs_with_a_person_is_the_boxs_back() -> None:
    points, labels = box_on_wall(0.4)
    found = with_finds(points, labels, [], [doll(0.4)], STEP, SKIN)
    assert (found[behind(points, 0.4)] == Label.CLUTTER).all()
    outside = (points[:, 1] == 0) & ((np.abs(points[:, 0]) > 0.29) | (points[:, 2] > 0.85) | (points[:, 2] < 0.35))
    assert (found[outside] == Label.WALL).all()
    assert (found == Label.VICTIM).any()


@pytest.mark.parametrize("person", [False, True])
def test_the_wall_in_a_box_without_a_person_or_on_the_ground_stays_a_wall(person: bool) -> None:
    z = 0.02 if person else 0.4
    points, labels = box_on_wall(z)
    found = with_finds(points, labels, [], [doll(z)] if person else [], STEP, SKIN)
    assert (found[behind(points, z)] == Label.WALL).all()


def test_the_wall_behind_a_person_alone_stays_a_wall() -> None:
    points, labels = box_on_wall(0.4)
    labels[labels == Label.CLUTTER] = Label.WALL
    found = with_finds(points, labels, [], [doll(0.4)], STEP, SKIN)
    assert (found[behind(points, 0.4)] == Label.WALL).all()
