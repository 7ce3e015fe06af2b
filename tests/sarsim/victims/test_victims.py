"""Victims: their MJCF in an arena, their true poses, and whether people rest on floor and wall."""

from xml.etree.ElementTree import Element, fromstring, tostring

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.errors import InputError
from pipeline.labels import Label
from sarsim.assets import asset
from sarsim.sensors.camera import geom_labels
from sarsim.victims.body import UPPER_BODY
from sarsim.victims.people import AGAINST_WALL, LIBRARY_STATURE, VERTEX_UNIT, bone_motions, people, skinned
from sarsim.victims.victims import (
    PLACEMENTS,
    SUITABLE_POSTURES,
    Placement,
    Posture,
    VictimModel,
    make_victim,
    victims_of,
)

KINDS = [(posture, placement) for placement in PLACEMENTS for posture in SUITABLE_POSTURES[placement]]
POSES = range(len(people().postures))
EMPTY = '<mujoco><size nuser_geom="1"/><worldbody/></mujoco>'


def model_of(*victims: tuple[VictimModel, tuple[float, float, float], float]) -> mujoco.MjModel:
    """Victims, each at a place and turned, in an empty world."""
    root: Element = fromstring(EMPTY)
    for victim, position, yaw in victims:
        victim.add_to(root, position, yaw)
    return mujoco.MjModel.from_xml_string(tostring(root, encoding="unicode"))


def at_rest(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


def mesh_places(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> NDArray[np.float64]:
    """(N, 3) vertices of a body's meshes in the world."""
    places = []
    for geom in np.flatnonzero((model.geom_bodyid == body) & (model.geom_dataid >= 0)):
        mesh = model.mesh(model.geom_dataid[geom])
        vertices = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]
        places.append(vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    return np.concatenate(places)


@pytest.mark.parametrize(("posture", "placement"), KINDS)
def test_a_victim_is_static_and_labelled_and_its_box_holds_it(posture: Posture, placement: Placement) -> None:
    victim = make_victim("7", np.random.default_rng(3), posture, placement)
    model = model_of((victim, (1.0, -2.0, 0.5), 0.7))
    data = at_rest(model)
    labels = geom_labels(model)
    body = model.body("victim_7").id
    assert model.njnt == 0 and model.nv == 0
    assert set(labels[model.geom_bodyid == body]) == {Label.VICTIM}
    assert set(labels[model.geom_bodyid != body]) <= {Label.CLUTTER, Label.WALL}
    (found,) = victims_of(model, data)
    assert found.id == "7"
    np.testing.assert_allclose(found.T_world_victim[:3, 3], (1, -2, 0.5))
    np.testing.assert_allclose(Rotation.from_matrix(found.T_world_victim[:3, :3]).as_rotvec(), (0, 0, 0.7), atol=1e-4)
    # Eyes and lips stand out from the face by a few millimetres.
    np.testing.assert_allclose(found.box, victim.box, atol=0.008)
    places = (mesh_places(model, data, body) - found.T_world_victim[:3, 3]) @ found.T_world_victim[:3, :3]
    assert np.all(places >= found.box[0] - 1e-4) and np.all(places <= found.box[1] + 1e-4)
    assert np.all(victim.footprint[0] <= victim.box[0, :2]) and np.all(victim.footprint[1] >= victim.box[1, :2])
    assert victim.height >= victim.box[1, 2] and victim.box[0, 2] >= 0


@pytest.mark.parametrize("placement", PLACEMENTS)
def test_the_same_seed_gives_the_same_victim(placement: Placement) -> None:
    def text(seed: int) -> str:
        root = fromstring(EMPTY)
        make_victim("a", np.random.default_rng(seed), placement=placement).add_to(root, (0, 0, 0), 0)
        return tostring(root, encoding="unicode")

    assert text(5) == text(5)
    assert text(5) != text(6)


def test_several_victims_are_distinguished() -> None:
    rng = np.random.default_rng(1)
    model = model_of(*[(make_victim(str(n), rng), (3.0 * n, 0.0, 0.0), 0.0) for n in range(3)])
    found = victims_of(model, at_rest(model))
    assert [victim.id for victim in found] == ["0", "1", "2"]
    assert [round(victim.centre[0]) for victim in found] == [0, 3, 6]
    assert len(np.unique(np.concatenate([victim.geoms for victim in found]))) == model.ngeom


@pytest.mark.parametrize("pose", POSES)
def test_people_rest_on_the_floor_and_against_the_wall(pose: int) -> None:
    """As the physics left them, before vertices are moved out of floor and wall; within 1 cm for the tallest."""
    library = people()
    with np.load(asset("victims", "people.npz")) as file:
        turns, offsets = bone_motions(file["rest"], file["poses"][pose])
        build = list(file["build_names"]).index(library.builds[pose])
        body = skinned(file["vertices"][build] * VERTEX_UNIT, file["weights"], turns, offsets) * (
            1.9 / LIBRARY_STATURE
        )
        parts, face_parts, faces = list(file["parts"]), file["face_parts"], file["faces"]
    posture = library.postures[pose]
    assert -0.01 < body[:, 2].min() < (0.2 if posture == "seated" else 0.01)
    if posture in ("lying", "prone", "side"):
        trunk = np.unique(faces[np.isin(face_parts, [parts.index("hips"), parts.index("chest")])])
        assert body[trunk, 2].min() < 0.05
    elif posture == "seated":
        hips = np.unique(faces[face_parts == parts.index("hips")])
        seat = 2 * library.seat_half_sizes * (1.9 / LIBRARY_STATURE)
        assert body[:, 0].min() > -0.02 and 0 < body[hips, 0].mean() < seat[0]
        above = (body[:, 0] < seat[0] - 0.05) & (np.abs(body[:, 1]) < seat[1] / 2) & (body[:, 2] > seat[2] - 0.2)
        assert body[above, 2].min() == pytest.approx(seat[2], abs=0.01)
    else:
        assert -0.01 < body[:, 0].min() < 0.01
        assert body[np.unique(faces[face_parts == parts.index("hips")]), 2].min() < 0.05


def test_rubble_does_not_go_through_the_person() -> None:
    for seed in range(6):
        model = model_of((make_victim("1", np.random.default_rng(seed), placement="rubble"), (0, 0, 0), 0))
        data = at_rest(model)
        person = mesh_places(model, data, model.body("victim_1").id)
        covers = np.flatnonzero(model.geom_bodyid == model.body("cover_1").id)
        assert covers.size >= 3
        for geom in covers:
            local = (person - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
            depth = (model.geom_size[geom] - np.abs(local)).min(axis=1).max()
            assert depth < 0.003


def test_a_bust_is_closed_and_smaller() -> None:
    figure = people().figure(int(np.flatnonzero(people().postures == "sitting")[0]), 1.7)
    bust = figure.only(UPPER_BODY)
    edges = np.sort(bust.body.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert np.all(np.unique(edges, axis=0, return_counts=True)[1] == 2)
    assert np.ptp(bust.visible_vertices("bald")[:, 2]) < 0.65 < np.ptp(figure.visible_vertices("bald")[:, 2])


def test_stature_scales_and_room_limits() -> None:
    small = make_victim("1", np.random.default_rng(0), "lying", stature=0.85)
    tall = make_victim("1", np.random.default_rng(0), "lying", stature=1.7)
    np.testing.assert_allclose(tall.box, 2 * small.box, atol=1e-9)
    fitting = make_victim("1", np.random.default_rng(0), "lying", stature=1.2, room=(1.4, 0.6))
    assert np.all(fitting.box[1, :2] - fitting.box[0, :2] <= (1.4, 0.6 + 0.02))  # the hair may be wider


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(InputError, match=r"victim 1: .*'box'"):
        make_victim("1", np.random.default_rng(0), "lying", "box")
    with pytest.raises(InputError, match=r"victim 1: .*prone .*0\.5 × 0\.5 m"):
        make_victim("1", np.random.default_rng(0), "prone", room=(0.5, 0.5))


def test_without_a_choice_no_wall_is_needed() -> None:
    for placement in PLACEMENTS:
        for seed in range(8):
            assert not make_victim("1", np.random.default_rng(seed), placement=placement).needs_wall
    assert all(make_victim("1", np.random.default_rng(0), posture).needs_wall for posture in AGAINST_WALL)
