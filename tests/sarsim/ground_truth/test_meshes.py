"""Triangles of geoms, against the shapes' formulas and MuJoCo's own ray casting."""

import mujoco
import numpy as np
import pytest

from sarsim.ground_truth.meshes import drawn_geoms, geom_colours, geom_poses, joined_mesh

SOLIDS = {
    "box": ('type="box" size="0.3 0.2 0.1"', 8 * 0.3 * 0.2 * 0.1),
    "sphere": ('type="sphere" size="0.3"', 4 / 3 * np.pi * 0.3**3),
    "ellipsoid": ('type="ellipsoid" size="0.3 0.2 0.1"', 4 / 3 * np.pi * 0.3 * 0.2 * 0.1),
    "cylinder": ('type="cylinder" size="0.2 0.3"', np.pi * 0.2**2 * 0.6),
    "capsule": ('type="capsule" size="0.2 0.3"', np.pi * 0.2**2 * 0.6 + 4 / 3 * np.pi * 0.2**3),
    "wedge": ('type="mesh" mesh="wedge"', 0.6 * 1.2 * 0.17 / 2),
}

MJCF = """
<mujoco>
  <asset>
    <mesh name="wedge" vertex="0 0 0  0.6 0 0  0 1.2 0  0.6 1.2 0  0.6 0 0.17  0.6 1.2 0.17"/>
    <texture name="half" type="2d" builtin="checker" rgb1="1 1 1" rgb2="0 0 0" width="64" height="64"/>
    <material name="checked" texture="half" rgba="1 0.5 0 1"/>
    <hfield name="hills" nrow="3" ncol="4" size="0.6 0.4 0.2 0.1" elevation="0 1 2 0  3 4 0 2  1 0 2 1"/>
  </asset>
  <worldbody>{}</worldbody>
</mujoco>
"""


def model_of(*geoms):
    return mujoco.MjModel.from_xml_string(MJCF.format("".join(f"<geom {geom}/>" for geom in geoms)))


def mesh_of(model, geoms=(0,)):
    return joined_mesh(model, geoms, geom_poses(model, geoms))


def corners(mesh):
    """(M, 3, 3) corners of the triangles, float64."""
    return mesh.vertices[mesh.triangles].astype(np.float64)


@pytest.mark.parametrize("name", SOLIDS)
def test_the_volume_is_the_shapes(name):
    geom, volume = SOLIDS[name]
    a, b, c = np.moveaxis(corners(mesh_of(model_of(geom))), 1, 0)
    # The divergence theorem; a triangle the wrong way round would count negative.
    enclosed = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    assert volume * 0.965 < enclosed < volume * 1.0001


@pytest.mark.parametrize("name", SOLIDS)
def test_normals_point_outwards_and_have_length_one(name):
    mesh = mesh_of(model_of(SOLIDS[name][0]))
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    a, b, c = np.moveaxis(corners(mesh), 1, 0)
    facing = np.cross(b - a, c - a)
    area = np.linalg.norm(facing, axis=1)
    sound = area > 1e-9  # at the poles, triangles shrink to lines
    along = np.einsum("ij,ikj->ik", facing[sound] / area[sound, None], mesh.normals[mesh.triangles][sound])
    assert along.min() > 0.7


@pytest.mark.parametrize("name", SOLIDS)
def test_vertices_lie_on_the_geom_that_a_ray_hits(name):
    turned = 'pos="0.5 -0.2 0.4" euler="30 50 -20"'
    model = model_of(f"{SOLIDS[name][0]} {turned}")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mesh = mesh_of(model)
    for vertex, normal in zip(mesh.vertices[::7], mesh.normals[::7], strict=True):
        inwards = 1e-3 * (mesh.vertices.mean(axis=0) - vertex)
        origin = (vertex + inwards + normal).astype(np.float64)
        distance = mujoco.mj_ray(model, data, origin, -normal.astype(np.float64), None, 1, -1, np.zeros(1, np.int32))
        assert distance == pytest.approx(1, abs=2e-3)


def test_a_plane_is_as_large_as_its_geom():
    mesh = mesh_of(model_of('type="plane" size="3 2 0.1"'))
    np.testing.assert_array_equal(mesh.vertices.min(axis=0), [-3, -2, 0])
    np.testing.assert_array_equal(mesh.vertices.max(axis=0), [3, 2, 0])
    np.testing.assert_array_equal(mesh.normals, np.tile([0, 0, 1], (4, 1)))


def test_an_endless_plane_ends_beyond_the_model():
    model = model_of('type="plane" size="0 0 0.1"', 'type="box" size="1 1 1"')
    assert mesh_of(model).vertices[:, :2].max() >= model.stat.extent


def test_a_height_field_has_the_heights_that_rays_hit():
    model = model_of('type="hfield" hfield="hills"')
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mesh = mesh_of(model)
    assert len(mesh.vertices) == 12
    for a, b, c in corners(mesh):
        for point in (0.98 * a + 0.01 * b + 0.01 * c, 0.01 * a + 0.01 * b + 0.98 * c):
            hit = mujoco.mj_ray(
                model, data, np.array([*point[:2], 5.0]), np.array([0, 0, -1.0]), None, 1, -1, np.zeros(1, np.int32)
            )
            assert 5 - hit == pytest.approx(point[2], abs=1e-5)
    facing = np.cross(corners(mesh)[:, 1] - corners(mesh)[:, 0], corners(mesh)[:, 2] - corners(mesh)[:, 0])
    assert (facing[:, 2] > 0).all()


def test_colours_are_the_materials_unless_the_geom_has_its_own():
    own, material, both = 'rgba="0.1 0.2 0.3 1"', 'material="checked"', 'material="checked" rgba="0 1 0 1"'
    model = model_of(*(f'type="sphere" size="0.1" {steps}' for steps in (own, material, both)))
    np.testing.assert_allclose(geom_colours(model)[0], [0.1, 0.2, 0.3, 1])
    # The mean of black and white squares halves the material's colour.
    np.testing.assert_allclose(geom_colours(model)[1], [0.5, 0.25, 0, 1], atol=0.01)
    np.testing.assert_allclose(geom_colours(model)[2], [0, 1, 0, 1])


def test_joined_meshes_keep_their_parts_apart():
    model = model_of('type="box" size="1 1 1" rgba="1 0 0 1"', 'type="box" size="1 1 1" pos="5 0 0" rgba="0 0 1 1"')
    mesh = mesh_of(model, (0, 1))
    assert len(mesh.vertices) == 48
    assert mesh.triangles.max() == 47
    red = mesh.colours[:, 0] == 255
    assert red.sum() == 24
    assert (mesh.vertices[red, 0] <= 1).all()
    assert (mesh.vertices[~red, 0] >= 4).all()
    sides = np.isin(mesh.triangles, np.flatnonzero(red)).sum(axis=1)
    assert set(sides) == {0, 3}


def test_collision_shapes_and_what_is_transparent_are_not_drawn():
    model = model_of(
        'type="sphere" size="0.1"', 'type="sphere" size="0.1" group="3"', 'type="sphere" size="0.1" rgba="1 1 1 0"'
    )
    assert drawn_geoms(model).tolist() == [True, False, False]
