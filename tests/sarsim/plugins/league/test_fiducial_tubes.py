"""Half circles in a map, and the distances of codes to them."""

import mujoco
import numpy as np
import pytest

from pipeline.plugins.league.brief import Rewards
from sarsim.plugins.league.fiducial_tubes import Tubes, is_well_placed, mapped_tubes, nearest_code, tubes_of
from sarsim.plugins.league.leagues import SmallRun, small_score

FEET = np.array([(0.0, 0, 0), (3.0, 0, 0), (0.0, 4, 0)])
TUBES = Tubes(FEET, np.array([1.0, 2.0, 1.0]), np.full(3, 0.15), [("A", np.array([1.0, 1.0, 0.5]))])


def half_circle(middle, side=1, radius=0.15):
    """(N, 3) m: what a robot at one side of a panel along x sees of it and of a tube that it cuts."""
    a, z = (n.ravel() for n in np.meshgrid(np.linspace(0, np.pi, 20), np.arange(0.3, 0.9, 0.05)))
    tube = np.stack([middle[0] + radius * np.cos(a), middle[1] + side * radius * np.sin(a), z], axis=1)
    u, z = (n.ravel() for n in np.meshgrid(np.arange(radius + 0.02, 0.6, 0.02), np.arange(0.0, 1.0, 0.05)))
    panel = [np.stack([middle[0] + way * u, middle[1] + 0 * u, z], axis=1) for way in (-1, 1)]
    return np.concatenate([tube, *panel])


def test_a_half_circle_is_found_where_the_map_shows_it():
    astray = np.array([(0.1, -0.05), (-0.12, 0.08), (0.0, 0.0)])
    points = np.concatenate(
        [half_circle(foot[:2] + d, side) for foot, d, side in zip(FEET, astray, (1, -1, 1), strict=True)]
    )
    noise = np.random.default_rng(0).normal(0, 0.005, points.shape)
    assert mapped_tubes(points + noise, TUBES) == pytest.approx(FEET[:, :2] + astray, abs=0.03)


@pytest.mark.parametrize("radius", [0.05, 0.4])
def test_a_tube_that_is_no_half_circle_does_not_show(radius):
    shown = mapped_tubes(half_circle(FEET[0], radius=radius), TUBES)
    assert np.isnan(shown).all()


def test_a_flat_panel_is_no_tube():
    u, z = (n.ravel() for n in np.meshgrid(np.arange(-0.6, 0.6, 0.02), np.arange(0.0, 1.0, 0.05)))
    assert np.isnan(mapped_tubes(np.stack([u, 0 * u, z], axis=1), TUBES)).all()


def test_both_nearest_distances_must_be_right():
    true = np.array([1.0, 1.0, 0.5])
    assert is_well_placed(true, true, FEET[:, :2], TUBES, 0.3)
    # 0.35 m along the direction to the nearest tube, the distance to the other is nearly right
    assert not is_well_placed(true + np.array([0.25, 0.25, 0]), true, FEET[:, :2], TUBES, 0.3)
    shown = FEET[:, :2].copy()
    shown[1] = np.nan
    assert not is_well_placed(true, true, shown, TUBES, 0.3)
    shown[1], shown[2] = FEET[1, :2], np.nan  # the third is not one of the two nearest
    assert is_well_placed(true, true, shown, TUBES, 0.3)


def test_the_whole_map_may_be_displaced():
    true, away = np.array([1.0, 1.0, 0.5]), np.array([0.2, -0.1, 0.0])
    assert is_well_placed(true + away, true, FEET[:, :2] + away[:2], TUBES, 0.01)


def test_a_reading_is_of_the_nearest_code_with_its_text():
    codes = [("A", np.zeros(3)), ("A", np.array([3.0, 0, 0])), ("B", np.array([2.0, 0, 0]))]
    assert nearest_code("A", np.array([2.0, 0, 0]), codes) is codes[1][1]
    assert nearest_code("C", np.zeros(3), codes) is None


@pytest.mark.parametrize(("alone", "points"), [(True, 4 * (5 + 4 * 3)), (False, 5 + 4 * 3)])
def test_points_of_the_small_league(alone, points):
    score = small_score(SmallRun(10, 5, 3, 10, 8, alone), Rewards())
    assert score["total"]["points"] == points == sum(r["points"] for n, r in score.items() if n != "total")


def test_tubes_of_a_model_are_found_by_their_names():
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom name="tube_0" type="cylinder" pos="1 2 0.5" size="0.15 0.5"/>'
        '<body name="code"><geom size="0.1"/></body></worldbody>'
        '<custom><text name="code" data="kind=qr_code;text=A;state="/></custom></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = tubes_of(model, data)
    assert found.feet == pytest.approx(np.array([(1, 2, 0)])) and found.heights == [1] and found.radii == [0.15]
    assert [text for text, _ in found.codes] == ["A"]
