"""Copies of a model that a ``<population>`` spreads over a world."""

import numpy as np
import pytest
from defusedxml.ElementTree import fromstring

from pipeline.errors import InputError
from sarsim.arenas.sdf.population import places_of
from sarsim.arenas.sdf.world import SdfWorld
from tests.sarsim.arenas.sdf.worlds import PLANE, box, include, model, write

BOX = "<box><size>4 2 1</size></box>"
TUBE = "<cylinder><radius>2</radius><length>1</length></cylinder>"


def population(region, kind, count=12, more="", pose="10 0 0.5 0 0 0", inside=""):
    return (
        f"<population name='p'><pose>{pose}</pose>{inside}<model_count>{count}</model_count>{region}"
        f"<distribution><type>{kind}</type>{more}</distribution></population>"
    )


def places(*arguments, **named):
    return places_of(fromstring(population(*arguments, **named)), "here")


@pytest.mark.parametrize("kind", ["random", "uniform"])
def test_copies_lie_in_their_region_and_always_in_the_same_places(kind):
    in_box, in_tube = places(BOX, kind), places(TUBE, kind)
    assert in_box.shape == in_tube.shape == (12, 3)
    assert (np.abs(in_box - (10, 0, 0.5)) <= (2, 1, 0.5)).all() and np.ptp(in_box, axis=0)[0] > 1.5
    assert (np.hypot(*(in_tube[:, :2] - (10, 0)).T) <= 2).all() and (np.abs(in_tube[:, 2] - 1) <= 0.5).all()
    np.testing.assert_array_equal(in_box, places(BOX, kind))


def test_uniform_copies_keep_apart():
    def least(points):
        apart = np.linalg.norm(points[:, None, :2] - points[None, :, :2], axis=2)
        return apart[~np.eye(len(points), dtype=bool)].min()

    assert least(places(BOX, "uniform")) > 2 * least(places(BOX, "random"))


@pytest.mark.parametrize(("kind", "axis", "length"), [("linear-x", 0, 4), ("linear-y", 1, 2), ("linear-z", 2, 1)])
def test_copies_in_a_line_are_evenly_spaced_from_the_regions_end(kind, axis, length):
    found = places(BOX, kind, 4)
    expected = np.tile([10, 0, 0.5], (4, 1))
    expected[:, axis] += length * (np.arange(4) / 4 - 0.5)
    np.testing.assert_allclose(found, expected)


def test_a_grid_is_about_its_place_and_turns_with_it():
    found = places("", "grid", more="<rows>2</rows><cols>3</cols><step>1 2 0</step>")
    np.testing.assert_allclose(found[:3], [(9, -1, 0.5), (10, -1, 0.5), (11, -1, 0.5)])
    np.testing.assert_allclose(found[3:], [(9, 1, 0.5), (10, 1, 0.5), (11, 1, 0.5)])


@pytest.mark.parametrize(
    "wrong",
    [
        population(BOX, "random", 10**9),
        population(BOX, "random", 0),
        population("", "grid", more="<rows>100000</rows><cols>100000</cols><step>1 1 1</step>"),
        population(TUBE, "linear-x"),
        population("<box><size>0 1 1</size></box>", "random"),
        population("", "random"),
    ],
)
def test_a_wrong_population_is_one_line_and_no_others_loss(wrong, tmp_path):
    with pytest.raises(InputError, match=r"^here"):
        places_of(fromstring(wrong), "here")
    world = SdfWorld(write(tmp_path, PLANE, wrong, model("m", box(1, 1, 1))))
    assert [m.name for m in world.models()] == ["ground_plane", "m"] and len(world.errors) == 1


def test_the_copies_of_a_world_are_models_without_the_pose_of_the_first(tmp_path):
    (tmp_path / "can").mkdir()
    (tmp_path / "can" / "model.sdf").write_text(f"<sdf>{model('can', box(0.1, 0.1, 0.1))}</sdf>")
    row = population(BOX, "linear-x", 2, inside=model("crate", box(1, 1, 1), pose="7 7 7 0 0 1"))
    cans = population(BOX, "linear-x", 1, inside=include("model://can", "tin"))
    world = SdfWorld(write(tmp_path, row, cans))
    assert [m.name for m in world.models()] == ["crate_clone_0", "crate_clone_1", "tin_clone_0"]
    poses = [m.T_world for m in world.models()]
    np.testing.assert_allclose(poses[0][:3], np.column_stack([np.eye(3), (8, 0, 0.5)]))
    assert len(list(world.shapes())) == 3
