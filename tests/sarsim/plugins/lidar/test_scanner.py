"""Scans: their geometry, their labels, their errors, and how they roll."""

from dataclasses import replace

import mujoco
import numpy as np
import open3d as o3d
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pipeline.labels import Label
from pipeline.transforms import from_rotation, from_yaw, transform_points
from sarsim.arenas.load import load_arena
from sarsim.environment import RescueEnvironment
from sarsim.ground_truth.meshes import drawn_geoms, joined_mesh
from sarsim.plugins.lidar.config import LidarConfig
from sarsim.plugins.lidar.scanner import ABOVE_CAMERA, MIN_COSINE, Scan, Scanner
from tests.sarsim.plugins.lidar.hall import CROSS, Hall, dense

FIELDS = ("points", "range", "ring", "column", "time", "normal", "label", "instance")


def same(a: Scan, b: Scan) -> bool:
    """Whether two scans are the same, bit for bit."""
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in FIELDS)


def test_four_beams_measure_the_hall_from_inside_a_robot():
    hall = Hall()
    scan = hall.scanner().scan(1.5)
    assert scan.start == 1.5
    assert_array_equal(scan.column, [0, 2, 3])  # back, ahead, left; nothing is on the right
    assert_allclose(scan.range, [3, 4, 3], atol=1e-6)
    assert_allclose(scan.points, [(-3, 0, 0), (4, 0, 0), (0, 3, 0)], atol=1e-6)
    assert_allclose(scan.normal, [(1, 0, 0), (-1, 0, 0), (0, -1, 0)], atol=1e-6)
    assert scan.label.tolist() == [Label.VICTIM, Label.WALL, Label.CLUTTER]
    assert [hall.name(geom) for geom in scan.instance] == ["ball", "ahead", "left"]
    assert_allclose(scan.intensity, 1, atol=1e-6)


def test_rows_go_up_and_down_at_their_elevations():
    """From a height of 1 m, the row at -30° meets the floor at 2 m, the one at 10° the wall, the one at 50° none."""
    model = replace(CROSS, elevations=(-30.0, 10.0, 50.0), columns=1)
    scan = Hall().scanner(model).scan(0.0)
    assert scan.ring.tolist() == [0, 1]
    cosine = np.cos(np.radians(10))
    assert_allclose(scan.range, [2.0, 4 / cosine], atol=1e-6)
    assert_allclose(scan.intensity, [0.5, cosine], atol=1e-6)
    assert scan.label.tolist() == [Label.TERRAIN, Label.WALL]


def test_points_and_normals_are_in_the_frame_of_the_lidar():
    hall = Hall()
    hall.move(1.0, 0.5, np.pi / 2)
    scanner = hall.scanner()
    scan = scanner.scan(0.0)
    assert_allclose(scan.T_world_lidar, from_yaw(1.0, 0.5, 1.0, np.pi / 2), atol=1e-9)
    ahead = transform_points(scan.T_world_lidar, scan.points[scan.column == 2])
    assert_allclose(ahead, [(1.0, 3.0, 1.0)], atol=1e-6)
    assert_allclose(scan.normal[scan.column == 2], [(-1, 0, 0)], atol=1e-6)


def test_a_robot_without_a_site_has_the_lidar_above_its_camera():
    hall = Hall(site="imu")
    assert_allclose(hall.scanner().T_base_lidar, from_yaw(0, 0, 0.94 + ABOVE_CAMERA, 0), atol=1e-9)


@pytest.mark.parametrize("robot", ["pioneer3at", "jackal"])
def test_no_part_of_a_robot_is_seen(robot):
    environment = RescueEnvironment(load_arena("nist_6x4"), robot)
    world, data = environment.physics.model.ptr, environment.physics.data.ptr
    base = environment.physics.bind(environment.robot.base).element_id
    scanner = Scanner(world, data, base, LidarConfig("32x360", range=(0.01, 30), vertical=(-80, 10)).model())
    groups = world.geom_group.copy()
    seen = scanner.scan(0.0).instance
    of_robot = world.body_rootid[world.geom_bodyid] == world.body_rootid[base]
    assert of_robot.sum() > 10
    assert len(seen) > 10_000
    assert not of_robot[seen].any()
    assert_array_equal(world.geom_group, groups)


def test_geoms_that_are_not_drawn_are_not_seen():
    hall = Hall()
    up = hall.scanner(replace(CROSS, elevations=(80.0, -80.0))).scan(0.0)
    assert {hall.name(geom) for geom in up.instance} == {"floor"}


def test_only_distances_in_range_return():
    hall = Hall()
    assert hall.scanner(replace(CROSS, range=(3.5, 30))).scan(0.0).column.tolist() == [2]
    assert hall.scanner(replace(CROSS, range=(0.1, 3.5))).scan(0.0).column.tolist() == [0, 3]


def test_the_noise_grows_with_distance_and_incidence():
    """Of 100,000 beams, the standard deviation is known to half a per cent."""
    hall = Hall()
    model = dense(sigma=(0.01, 0.31), detection_range=1e9)
    assert hall.scanner(model, seed=0).scan(0.0).range.std() == pytest.approx(0.01 + 0.3 * 4 / 30, rel=0.02)
    hall.move(yaw=np.radians(60))
    oblique = hall.scanner(replace(model, sigma=(0.02, 0.02)), seed=0).scan(0.0)
    true = hall.scanner(model).scan(0.0)
    wall = np.isin(true.column, oblique.column)
    assert (oblique.range - true.range[wall]).std() == pytest.approx(0.02 / np.cos(np.radians(30)), rel=0.02)


def test_the_noise_grows_no_further_at_grazing_incidence():
    hall = Hall()
    model = replace(dense(sigma=(0.001, 0.001), detection_range=1e9), elevations=(-5.0,))
    errors = hall.scanner(model, seed=0).scan(0.0).range - hall.scanner(model).scan(0.0).range
    assert errors.std() == pytest.approx(0.001, rel=0.02)  # of the wall, which is nearer than the floor
    hall.move(-15.0)
    errors = hall.scanner(model, seed=0).scan(0.0).range - hall.scanner(model).scan(0.0).range
    assert errors.std() == pytest.approx(0.001 / MIN_COSINE, rel=0.02)


def test_beams_return_less_the_farther_and_the_more_oblique():
    """At the range and normal incidence, the stated probability; elsewhere its power (distance / range)² / cosine."""
    hall = Hall()
    model = dense(detection_range=4.0, detection_probability=0.8)
    beams = model.columns
    assert len(hall.scanner(model, seed=0).scan(0.0)) / beams == pytest.approx(0.8, abs=0.005)
    hall.move(-4.0, -2.0)
    assert len(hall.scanner(model, seed=0).scan(0.0)) / beams == pytest.approx(0.8**4, abs=0.005)
    hall.move(yaw=np.radians(60))  # towards the wall on the left, 30° from its normal
    share = 0.8 ** ((3 / np.cos(np.radians(30)) / 4) ** 2 / np.cos(np.radians(30)))
    assert len(hall.scanner(model, seed=0).scan(0.0)) / beams == pytest.approx(share, abs=0.005)


def test_the_seed_decides_every_bit():
    hall = Hall()
    scans = [hall.scanner("16x90", seed).scan(0.0) for seed in (0, 0, 1)]
    assert same(scans[0], scans[1])
    assert not same(scans[0], scans[2])


@pytest.mark.parametrize("arena", ["nist_6x4", "random:3"])
def test_labels_and_distances_are_those_of_an_independent_ray_cast(arena):
    """Open3D's, of the same surfaces as triangles: round things and edges of meshes may differ by a beam."""
    environment = RescueEnvironment(load_arena(arena))
    world, data = environment.physics.model.ptr, environment.physics.data.ptr
    base = environment.physics.bind(environment.robot.base).element_id
    model = LidarConfig("32x512", range=(1e-3, 100.0), vertical=(-25, 25)).model()
    scanner = Scanner(world, data, base, model)
    scan = scanner.scan(0.0)
    geoms = np.flatnonzero(drawn_geoms(world) & (world.body_rootid[world.geom_bodyid] != world.body_rootid[base]))
    scene = o3d.t.geometry.RaycastingScene()
    for geom in geoms:
        mesh = joined_mesh(world, [geom], [from_rotation(data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom])])
        scene.add_triangles(*map(o3d.core.Tensor.from_numpy, (mesh.vertices, mesh.triangles)))
    # The beams' directions are computed anew, from the data sheet's angles.
    up = np.radians(np.linspace(-25, 25, 32))[:, None]
    around = np.linspace(-np.pi, np.pi, 512, endpoint=False)
    directions = np.stack(
        np.broadcast_arrays(np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)), -1
    )
    T = scan.T_world_lidar
    rays = np.concatenate([np.tile(T[:3, 3], (32 * 512, 1)), directions.reshape(-1, 3) @ T[:3, :3].T], axis=1)
    hits = scene.cast_rays(o3d.core.Tensor.from_numpy(rays.astype(np.float32)))
    number, distance = hits["geometry_ids"].numpy(), hits["t_hit"].numpy()
    theirs = np.where(np.isfinite(distance), geoms[np.minimum(number, len(geoms) - 1)], -1)
    ours, beams = np.full(32 * 512, -1), scan.ring.astype(int) * 512 + scan.column
    ours[beams] = scan.instance
    labels = np.append(world.geom_user[:, 0], 255)
    agree = labels[ours] == labels[theirs]
    assert (labels[ours[beams]] == scan.label).all()
    assert len({*scan.label.tolist()}) >= 4
    assert agree.mean() >= 0.999
    both = agree[beams] & (theirs[beams] >= 0)
    errors = np.abs(scan.range[both] - distance[beams][both])
    assert np.median(errors) < 1e-6
    assert np.quantile(errors, 0.999) < 5e-3  # round things are prisms of 24 sides there


def test_height_fields_and_meshes_are_seen():
    text = """<mujoco><size nuser_geom="1"/><asset>
    <hfield name="hills" nrow="2" ncol="2" size="5 5 1 0.1" elevation="1 1 0 0"/>
    <mesh name="wedge" vertex="2 -1 0  2 1 0  2 -1 3  2 1 3  3 -1 0  3 1 0"/></asset><worldbody>
    <geom type="hfield" hfield="hills" user="3"/><geom type="mesh" mesh="wedge" pos="0 0 0" user="7"/>
    <body name="base_link" pos="0 0 2"><site name="lidar"/><geom size="0.1"/></body></worldbody></mujoco>"""
    world = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(world)
    mujoco.mj_forward(world, data)
    model = replace(CROSS, elevations=(0.0, -60.0))
    scan = Scanner(world, data, world.body("base_link").id, model).scan(0.0)
    ahead = (scan.ring == 0) & (scan.column == 2)
    assert scan.label[ahead].tolist() == [Label.CLUTTER]
    assert_allclose(scan.range[ahead], [2.0], atol=1e-5)
    assert (scan.label[scan.ring == 1] == Label.INCLINED_RAMP).sum() >= 3
    behind = scan.normal[(scan.ring == 1) & (scan.column == 0)]
    assert_allclose(behind, [np.array([0, -1, 10]) / np.sqrt(101)], atol=1e-5)  # it climbs by 1 m in 10 m along y


def test_a_lidar_that_does_not_roll_scans_at_its_rate():
    hall = Hall()
    scanner = hall.scanner(replace(CROSS, rate=10))
    starts = [scan.start for k in range(26) for scan in scanner.advance(0.04 * k)]
    assert_allclose(starts, [0, 0.12, 0.2, 0.32, 0.4, 0.52, 0.6, 0.72, 0.8, 0.92, 1.0])
    fast = hall.scanner(replace(CROSS, rate=40))
    assert len([scan for k in range(26) for scan in fast.advance(0.04 * k)]) == 26


def test_a_rolling_scan_measures_each_column_where_the_robot_is_at_its_time():
    """The robot drives ahead at 1 m/s; 400 columns take 0.1 s, of which the one ahead is fired after 0.05 s."""
    hall, model = Hall(), replace(CROSS, columns=400, rate=10)
    scanner = hall.scanner(model, rolls=True)
    scans = []
    for k in range(8):
        hall.move(0.04 * k)
        scans += scanner.advance(0.04 * k)
    assert [scan.start for scan in scans] == pytest.approx([0, 0.1])
    first, second = scans
    (ahead,) = np.flatnonzero(first.column == 200)
    assert first.time[ahead] == pytest.approx(0.05)
    assert first.range[ahead] == pytest.approx(4 - 0.05, abs=1e-5)
    assert second.range[second.column == 200] == pytest.approx(4 - 0.15, abs=1e-5)
    (behind,) = np.flatnonzero(first.column == 0)
    assert first.range[behind] == pytest.approx(3, abs=1e-5)
    assert_allclose(second.T_world_lidar, from_yaw(0.1, 0, 1, 0), atol=1e-9)
    assert_allclose(first.points[ahead], [3.95, 0, 0], atol=1e-5)


def test_a_rolling_scan_of_a_turning_robot_is_bent():
    """While the robot turns by 0.4 rad a second, the column ahead looks 0.02 rad to the left of where it began."""
    hall, model = Hall(), replace(CROSS, columns=400, rate=10)
    scanner = hall.scanner(model, rolls=True)
    scans = []
    for k in range(4):
        hall.move(yaw=0.4 * 0.04 * k)
        scans += scanner.advance(0.04 * k)
    (scan,) = scans
    assert scan.range[scan.column == 200] == pytest.approx(4 / np.cos(0.02), abs=1e-5)


def test_a_rolling_scan_of_a_robot_at_rest_is_like_any_other():
    hall = Hall()
    model = LidarConfig("8x90").model()
    still, rolling = hall.scanner(model).scan(0.0), hall.scanner(model, rolls=True)
    (scan,) = [scan for k in range(4) for scan in rolling.advance(0.04 * k)]
    order = np.lexsort([scan.column, scan.ring])
    assert_allclose(scan.range[order], still.range, atol=1e-6)
    assert_array_equal(scan.instance[order], still.instance)
    assert_allclose(scan.time, scan.column / 900, atol=1e-7)


def test_a_fast_rolling_lidar_completes_several_turns_in_a_control_period():
    hall = Hall()
    scanner = hall.scanner(LidarConfig("utm-30lx").model(), rolls=True)
    starts = [scan.start for k in range(6) for scan in scanner.advance(0.04 * k)]
    assert_allclose(starts, 0.025 * np.arange(8))
