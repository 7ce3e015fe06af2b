"""Worlds of strangers, against the numbers that a second reader finds in its files."""

import mujoco
import numpy as np
import pytest
from scipy.spatial import KDTree

from sarsim.ground_truth.shapes import mesh_vertices
from tests.sarsim.arenas.sdf.peer import Shape, shapes_of
from tests.sarsim.arenas.sdf.worlds import Compiled

MM = 1e-3
KINDS = {"box": mujoco.mjtGeom.mjGEOM_BOX, "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER}
KINDS |= {"sphere": mujoco.mjtGeom.mjGEOM_SPHERE}


def sizes_of(shape: Shape) -> np.ndarray:
    """MuJoCo's sizes: half of what SDF gives, but of radii."""
    if shape.kind == "box":
        return shape.numbers / 2
    return shape.numbers * (1, 0.5)[: len(shape.numbers)]


def points_of(arena, kind):
    """(N, 3) m, the places of the geoms of a kind, or the vertices of all meshes, and the geoms themselves."""
    model, data = arena.model, arena.data
    geoms = np.flatnonzero(model.geom_type == KINDS.get(kind, mujoco.mjtGeom.mjGEOM_MESH))
    if kind in KINDS:
        return data.geom_xpos[geoms], geoms
    return np.concatenate(
        [mesh_vertices(model, g) @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g] for g in geoms]
    ), geoms


def check(arena, shapes):
    for kind in {shape.kind for shape in shapes}:
        places, geoms = points_of(arena, kind)
        expected = [shape for shape in shapes if shape.kind == kind]
        if kind == "mesh":
            away, _ = KDTree(places).query(np.concatenate([shape.numbers for shape in expected]))
            assert away.max() <= MM
            low, high = (f(np.concatenate([s.numbers for s in expected]), axis=0) for f in (np.min, np.max))
            assert np.abs(places.min(axis=0) - low).max() <= MM and np.abs(places.max(axis=0) - high).max() <= MM
            continue
        away, nearest = KDTree(places).query([shape.T[:3, 3] for shape in expected])
        assert away.max() <= MM and len(geoms) == len(expected) == len(set(nearest))
        for shape, n in zip(expected, nearest, strict=True):
            size = sizes_of(shape)
            np.testing.assert_allclose(arena.model.geom_size[geoms[n], : len(size)], size, atol=MM)
            turn = arena.data.geom_xmat[geoms[n]].reshape(3, 3)
            assert np.abs(turn - shape.T[:3, :3]).max() * np.linalg.norm(size) <= MM or kind == "sphere"


@pytest.mark.parametrize(("folder", "every"), [("barn", 5), ("cases", 1), ("worlds", 1)])
def test_places_and_sizes_are_those_of_the_file(shared, folder, every):
    """BARN's worlds are all of one generator, so a few speak for the others."""
    worlds = sorted((shared / folder).rglob("*.world"))
    assert worlds
    for world in worlds[::every]:
        shapes = list(shapes_of(world))
        assert shapes, world
        check(Compiled(world), shapes)
