"""Columns against MuJoCo's own rays, and places above each other."""

import tracemalloc

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipeline.grid_map import Grid
from pipeline.labels import Label
from sarsim.ground_truth.columns import columns, convex_bodies
from sarsim.ground_truth.true_surface import Survey

FLOOR = '<geom type="plane" size="2 2 0.1" user="2"/>'
TABLE = '<geom type="box" pos="0 0 1" size="0.8 0.8 0.05" user="4"/>'
HIGH = 10.0


def compiled(geoms, assets=""):
    xml = f'<mujoco><size nuser_geom="1"/><asset>{assets}</asset><worldbody>{geoms}</worldbody></mujoco>'
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def highest(model, data, grid):
    """(nx, ny) highest surface by the columns, and by rays; NaN if there is none."""
    c = columns(convex_bodies(model, data, None), grid)
    by_columns, by_rays = np.full(grid.shape, np.nan), np.full(grid.shape, np.nan)
    geom = np.zeros(1, np.int32)
    for i, j in np.ndindex(grid.shape):
        if c.count[i, j]:
            by_columns[i, j] = c.top[c.start[i, j] + c.count[i, j] - 1]
        point = np.array([*grid.centre_of((i, j)), HIGH])
        distance = mujoco.mj_ray(model, data, point, np.array([0, 0, -1.0]), None, 1, -1, geom, None)
        by_rays[i, j] = HIGH - distance if distance >= 0 else np.nan
    return by_columns, by_rays


GRID = Grid(np.array([-30, -30]), 0.05, (60, 60))

SHAPES = {
    "box": 'type="box" size="0.4 0.2 0.3"',
    "sphere": 'type="sphere" size="0.5"',
    "ellipsoid": 'type="ellipsoid" size="0.5 0.3 0.2"',
    "capsule": 'type="capsule" size="0.2 0.4"',
    "cylinder": 'type="cylinder" size="0.3 0.4"',
    "mesh": 'type="mesh" mesh="wedge"',
}
WEDGE = '<mesh name="wedge" vertex="0 0 0  0.6 0 0  0 0.6 0  0.6 0.6 0  0.6 0 0.4  0.6 0.6 0.2"/>'


@pytest.mark.parametrize("shape", sorted(SHAPES))
@pytest.mark.parametrize("quat", ["1 0 0 0", "0.8 0.2 -0.4 0.4"])
def test_tops_are_where_rays_meet_them(shape, quat):
    geom = f'<geom {SHAPES[shape]} pos="0.1 -0.2 0.7" quat="{quat}" user="7"/>'
    by_columns, by_rays = highest(*compiled(geom, WEDGE), GRID)
    both = ~np.isnan(by_columns) & ~np.isnan(by_rays)
    assert both.sum() > 40
    # A round shape is a polyhedron here: its rim may miss a few cells, and it lies up to 1% of its radius lower.
    assert (np.isnan(by_columns) != np.isnan(by_rays)).sum() <= 0.05 * both.sum()
    error = np.abs(by_columns - by_rays)[both]
    if shape in ("box", "mesh"):
        assert error.max() < 1e-4
    else:
        assert np.quantile(error, 0.9) < 0.02
        assert np.median(error) < 0.006


def test_the_world_of_many_shapes_agrees_with_rays():
    rng = np.random.default_rng(0)
    geoms = FLOOR
    for _ in range(30):
        x, y, z = rng.uniform((-1.4, -1.4, 0), (1.4, 1.4, 1))
        half = rng.uniform(0.05, 0.3, 3)
        geoms += f'<geom type="box" pos="{x} {y} {z}" size="{half[0]} {half[1]} {half[2]}" user="7"/>'
    by_columns, by_rays = highest(*compiled(geoms), GRID)
    assert_allclose(by_columns, by_rays, atol=1e-6)


def test_below_and_on_a_table_are_two_places():
    survey = Survey(*compiled(FLOOR + TABLE), None)
    assert survey.ground_height_near(np.array([0, 0, 0.1])) == pytest.approx(0)
    assert survey.ground_height_near(np.array([0, 0, 1.0])) == pytest.approx(1.05)
    assert survey.ground_height_near(np.array([0, 0, 0.5])) is None
    assert survey.ground_height_near(np.array([9.0, 0, 0])) is None
    floor = survey.ground_from(np.array([1.5, 1.5, 0]))
    assert floor.grid.at(floor.height, [0, 0]) == pytest.approx(0)
    top = survey.ground_from(np.array([0, 0, 1.05]))
    assert top.grid.at(top.height, [0, 0]) == pytest.approx(1.05)
    assert np.isnan(top.grid.at(top.height, [1.5, 1.5], outside=np.nan))


def test_a_low_table_is_no_roof_to_drive_under():
    low = TABLE.replace("0 0 1", "0 0 0.5")
    survey = Survey(*compiled(FLOOR + low), None)
    floor = survey.ground_from(np.array([1.5, 1.5, 0]))
    assert np.isnan(floor.grid.at(floor.height, [0, 0]))
    assert not floor.grid.at(floor.pieces, [0.9, 0.0])
    assert floor.grid.at(floor.pieces, [1.3, 0.0])


def test_grounds_find_every_patch_of_floor():
    slab = '<geom type="box" pos="{} 0 {}" size="1 1 0.05" user="2"/>'
    survey = Survey(*compiled(slab.format(0, -0.05) + slab.format(4, 0.95)), None)
    heights = sorted(float(np.nanmedian(g.height)) for g in survey.grounds(Label.TERRAIN, 0.1))
    assert heights == pytest.approx([0.0, 1.0])
    assert not list(survey.grounds(Label.STRAIGHT_RAMP, 0.1))


def test_the_label_of_the_ground_is_that_of_its_top():
    deck = '<geom type="box" pos="0 0 0.03" size="0.5 0.5 0.03" user="4"/>'
    survey = Survey(*compiled(FLOOR + deck), None)
    ground = survey.ground_from(np.array([1.5, 1.5, 0]))
    assert ground.grid.at(ground.label, [0, 0]) == Label.STRAIGHT_RAMP
    assert ground.grid.at(ground.label, [1.0, 0]) == Label.TERRAIN


FIELD = '<hfield name="hills" nrow="{0}" ncol="{0}" size="1 0.8 0.5 0.2" elevation="{1}"/>'


def hills(n):
    return FIELD.format(n, " ".join(f"{height:.3f}" for height in np.random.default_rng(0).random(n * n)))


def test_height_fields_agree_with_rays_and_keep_their_own_labels():
    field = '<geom type="hfield" hfield="hills" pos="{}" euler="0 0 {}" user="{}"/>'
    geoms = field.format("0.1 -0.2 0.3", 20, 5) + FLOOR + field.format("0.2 0.1 -0.1", 0, 4)
    model, data = compiled(geoms, hills(9))
    by_columns, by_rays = highest(model, data, GRID)
    assert_allclose(by_columns, by_rays, atol=1e-5)
    bodies = convex_bodies(model, data, None)
    assert np.bincount(bodies.label).tolist()[2:6] == [1, 0, 128, 128]


def test_a_height_field_takes_less_than_a_kilobyte_per_triangle():
    model, data = compiled('<geom type="hfield" hfield="hills"/>', hills(60))
    tracemalloc.start()
    bodies = convex_bodies(model, data, None)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1000 * len(bodies.label)


ENDLESS_FLOOR = '<geom type="plane" size="0 0 0.1" pos="{} 0 0" user="2"/>'
WALLS = '<geom type="box" pos="{} 0 0.5" size="0.1 2 0.5" user="1"/>'


def ends(geoms):
    """Lowest and highest x and y of the floor, the first body."""
    bodies = convex_bodies(*compiled(geoms), None)
    return [*bodies.low[0, :2], *bodies.high[0, :2]]


def test_an_infinite_plane_is_a_square_of_50_m_if_it_is_alone():
    assert ends(ENDLESS_FLOOR.format(3)) == [-22, -25, 28, 25]


def test_an_infinite_plane_extends_beyond_everything_else():
    for centre, half_length in ((100, 0.1), (0, 34.1)):
        walls = WALLS.format(centre - half_length + 0.1) + WALLS.format(centre + half_length - 0.1)
        low_x, low_y, high_x, high_y = ends(ENDLESS_FLOOR.format(0) + walls)
        assert (low_x + high_x, low_y + high_y) == pytest.approx((2 * centre, 0))
        assert (high_x - low_x) / 2 - half_length == pytest.approx(high_y - 2)
        assert (high_x - low_x) * (high_y - low_y) == pytest.approx(2500)
    around = WALLS.format(-30) + WALLS.format(30) + FLOOR.replace("2 2", "5 30")
    assert ends(ENDLESS_FLOOR.format(0) + around) == pytest.approx([-31.1, -31, 31.1, 31])


def test_infinite_planes_end_at_the_same_place_in_the_world():
    bodies = convex_bodies(*compiled(ENDLESS_FLOOR.format(0) + ENDLESS_FLOOR.format(7) + FLOOR), None)
    assert_allclose(bodies.low[1, :2], bodies.low[0, :2])
    band = FLOOR.replace("2 2", "0 1").replace("/>", ' euler="0 0 90"/>')
    low_x, low_y, high_x, high_y = ends(band + WALLS.format(60))
    assert (low_x, high_x) == pytest.approx((-1, 1))
    assert low_y < -2 and high_y > 2
