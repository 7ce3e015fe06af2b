"""Few convex parts that are as solid as a surface."""

from pathlib import Path

import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull, Delaunay

from sarsim.arenas.sdf.meshes import MeshSurface
from sarsim.arenas.sdf.pieces import pieces_of, with_volume
from tests.sarsim.arenas.sdf.worlds import PLANE, Compiled, mesh, model, room, write

CELLS = st.lists(st.booleans(), min_size=16, max_size=16).map(lambda cells: np.reshape(cells, (4, 4)))


def parts_of(mesh: trimesh.Trimesh) -> list[np.ndarray]:
    """The parts of a mesh of one connected piece."""
    (piece,) = pieces_of(MeshSurface("", mesh.vertices, mesh.faces))
    return piece.parts


def filled(parts: list[np.ndarray], points: np.ndarray) -> np.ndarray:
    """Which points (N, 3) lie in a part."""
    return np.any([Delaunay(part).find_simplex(points) >= 0 for part in parts], axis=0)


def drawn_out(plan: shapely.Polygon, height: float) -> trimesh.Trimesh:
    """A closed shape over a plan."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(plan))
    corners = np.concatenate([shapely.get_coordinates(triangle)[:3] for triangle in triangles])
    vertices, which = np.unique(corners.round(9), axis=0, return_inverse=True)
    return trimesh.creation.extrude_triangulation(vertices, which.reshape(-1, 3), height)


def grid(plan: shapely.Polygon, z: float) -> np.ndarray:
    """Points (N, 3) around a plan, none on a round coordinate."""
    (x0, y0, x1, y1), step = plan.bounds, 0.05
    xy = np.mgrid[x0 - 0.07 : x1 + 0.1 : step, y0 - 0.07 : y1 + 0.1 : step].reshape(2, -1).T + 0.013
    return np.column_stack([xy, np.full(len(xy), z)])


@given(CELLS, st.floats(0, 3), st.floats(0.3, 3))
@settings(max_examples=40, deadline=None)
def test_prisms_fill_what_is_drawn_out_and_nothing_else(cells, yaw, height):
    blocks = [shapely.box(i, j, i + 1, j + 1) for i, j in np.argwhere(cells)]
    joined = shapely.union_all(blocks)
    plan = max(shapely.get_parts(joined), key=lambda part: part.area, default=None)
    if plan is None or not plan.is_simple:
        return
    plan = shapely.affinity.rotate(shapely.Polygon(plan.exterior).buffer(0).simplify(1e-9), yaw, use_radians=True)
    parts = parts_of(drawn_out(plan, height))
    points = grid(plan, height / 2)
    inside = shapely.contains_xy(plan.buffer(-2e-3), *points[:, :2].T)
    outside = ~shapely.contains_xy(plan.buffer(2e-3), *points[:, :2].T)
    is_filled = filled(parts, points)
    assert is_filled[inside].all() and not is_filled[outside].any()


def test_a_wall_with_a_doorway_is_three_parts():
    wall = shapely.Polygon([(0, 0), (2, 0), (2, 2), (3, 2), (3, 0), (6, 0), (6, 3), (0, 3)])
    upright = drawn_out(wall, 0.1).apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0)))
    parts = parts_of(upright)
    assert len(parts) == 3
    assert filled(parts, np.array([(2.5, -0.05, 1.9), (2.5, -0.05, 2.1), (1.9, -0.05, 1)])).tolist() == [0, 1, 1]


def test_a_room_keeps_its_doorway():
    parts = parts_of(room())
    assert len(parts) <= 7
    assert filled(parts, np.array([(1.9, 0, 0.5), (1.9, 0.6, 0.5), (0, 0, 0.5)])).tolist() == [0, 1, 0]


@pytest.mark.parametrize(("wide", "is_solid"), [(0.2, True), (3.0, False)])
def test_what_is_open_below_is_solid_only_if_nobody_fits_in(wide, is_solid):
    box = trimesh.creation.box((4, wide, 2.5))
    box.update_faces(box.face_normals[:, 2] > -0.5)
    parts = parts_of(box)
    assert filled(parts, np.zeros((1, 3))).tolist() == [is_solid]
    assert len(parts) == (1 if is_solid else 5)


def test_a_floor_within_walls_stays():
    walls = shapely.box(-2, -2, 2, 2) - shapely.box(-1.8, -1.8, 1.8, 1.8)
    mesh = drawn_out(walls, 1.0)
    mesh.update_faces(mesh.face_normals[:, 2] > -0.5)
    floor = trimesh.Trimesh([(-1.8, -1.8, 0), (1.8, -1.8, 0), (1.8, 1.8, 0), (-1.8, 1.8, 0)], [(0, 1, 2), (0, 2, 3)])
    parts = parts_of(trimesh.util.concatenate([mesh, floor]))
    under, above = np.array([(0.5, 0.3, -1e-4)]), np.array([(0.5, 0.3, 0.1)])
    assert filled(parts, under).all() and not filled(parts, above).any()


def test_leaning_walls_keep_their_ends():
    box = trimesh.creation.box((3, 0.15, 4))
    box.vertices[box.vertices[:, 2] > 0, 0] += 0.03
    box.update_faces(box.face_normals[:, 2] > -0.5)
    (part,) = parts_of(box)
    np.testing.assert_allclose(np.sort(part, axis=0), np.sort(box.vertices, axis=0), atol=1e-9)


def test_coplanar_triangles_become_few_plates():
    x, y = np.meshgrid(np.arange(6.0), np.arange(6.0))
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(36)])
    corner = (np.arange(5)[:, None] * 6 + np.arange(5)).ravel()
    triangles = np.concatenate([[(c, c + 1, c + 7), (c, c + 7, c + 6)] for c in corner])
    (plate,) = parts_of(trimesh.Trimesh(vertices, triangles))
    assert np.ptp(plate, axis=0)[:2].tolist() == [5, 5]


@pytest.mark.parametrize("far", [0.0, 3000.0, 8000.0])
def test_flat_parts_far_from_the_origin_of_their_mesh_still_have_volume(far: float, tmp_path: Path) -> None:
    """MuJoCo stores corners in single precision, which far from the origin is coarser than a thin plate."""
    corners = np.array([(0, 0, 0), (2, 0, 0), (2, 0, 1), (0, 0, 1), (2, 2, 0), (2, 2, 1.7)])
    corners[:, :2] += far
    sheet = trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3), (1, 4, 5), (1, 5, 2), (0, 1, 4)], process=False)
    sheet.export(tmp_path / "sheet.stl")
    world = Compiled(write(tmp_path, PLANE, model("m", mesh("sheet.stl"), pose=f"{-far} {-far} 0 0 0 0")))
    assert world.ray(1, -1, 0.5, along=(0, 1, 0)) == pytest.approx(1, abs=2e-3)


@pytest.mark.parametrize("corners", [np.eye(3), np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])])
def test_a_flat_part_becomes_a_thin_plate(corners: np.ndarray) -> None:
    plate = with_volume(corners)
    assert plate is not None
    assert 0 < ConvexHull(plate).volume < 1e-3
    assert with_volume(plate) is plate
    assert with_volume(np.array([(0.0, 0, 0), (1, 0, 0), (2, 0, 0)])) is None
