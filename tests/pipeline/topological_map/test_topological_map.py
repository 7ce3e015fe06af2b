import json

import networkx as nx
import numpy as np
import pytest

from pipeline.elevation_map.traversability import assess_map
from pipeline.labels import Label
from pipeline.planning.path_plan import plan_path
from pipeline.planning.pose_paths import PosePaths
from pipeline.segments.planes import PlanePatch
from pipeline.segments.segments import Segments
from pipeline.topological_map.config import TopologicalMapConfig
from pipeline.topological_map.placement import segment_node_positions
from pipeline.topological_map.topological_map import TopologicalMap
from pipeline.transforms import from_yaw
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.topological_map.grounds import patch, room, topology_of
from tests.pipeline.worlds import RISE, RUN, flat, ground_points, ramp_and_deck, surface_of, wall_points

CONFIG = TopologicalMapConfig()


def ramp_patches() -> list[PlanePatch]:
    """What a robot before a ramp sees: floor, the ramp, and a deck 2.4 m long."""
    floor = ground_points(ramp_and_deck, (-3, 0), (-1, 1))
    slope = ground_points(ramp_and_deck, (0, RUN), (-0.6, 0.6))
    deck = ground_points(ramp_and_deck, (RUN, RUN + 2.4), (-0.6, 0.6))
    labels = (Label.TERRAIN, Label.INCLINED_RAMP, Label.STRAIGHT_RAMP)
    return [patch(label, p, (0, 0, 5)) for label, p in zip(labels, (floor, slope, deck), strict=True)]


@pytest.fixture(scope="module")
def ramp_world():
    traversability = assess_map(surface_of(ground_points(ramp_and_deck, (-3, RUN + 2.4), (-2, 2))))
    segments = Segments()
    patches = ramp_patches()
    segments.update(patches, 0, np.eye(4))
    topology = TopologicalMap()
    topology.update(patches, segments, PosePaths(traversability, (-1.5, 0)))
    return traversability, segments, patches, topology


def test_a_large_deck_has_a_node_in_each_half():
    segments = Segments()
    segments.update(ramp_patches(), 0, np.eye(4))
    nodes = segment_node_positions(segments.of(Label.STRAIGHT_RAMP)[0], PIONEER, CONFIG)
    np.testing.assert_allclose(sorted(nodes[:, 0]), [RUN + 0.6, RUN + 1.8], atol=0.05)
    np.testing.assert_allclose(nodes[:, 1:], [[0, RISE]] * 2, atol=0.02)


def test_a_small_deck_has_one_in_its_middle():
    segments = Segments()
    deck = ground_points(ramp_and_deck, (RUN, RUN + 1.6), (-0.6, 0.6))
    segments.update([patch(Label.STRAIGHT_RAMP, deck, (0, 0, 5))], 0, np.eye(4))
    np.testing.assert_allclose(
        segment_node_positions(next(iter(segments)), PIONEER, CONFIG), [[RUN + 0.8, 0, RISE]], atol=0.05
    )


def test_the_node_of_an_inclined_ramp_lies_before_its_bottom():
    segments = Segments()
    segments.update(ramp_patches(), 0, np.eye(4))
    nodes = segment_node_positions(segments.of(Label.INCLINED_RAMP)[0], PIONEER, CONFIG)
    np.testing.assert_allclose(nodes, [[-0.45, 0, 0]], atol=0.03)


def test_the_side_of_a_ramp_has_no_node():
    segments = Segments()
    side = wall_points((0, -0.6), (RUN, -0.6), height=0.3)
    segments.update([patch(Label.INCLINED_RAMP, side, (0, -3, 1))], 0, np.eye(4))
    assert len(segment_node_positions(next(iter(segments)), PIONEER, CONFIG)) == 0


def test_nodes_and_tree_lead_up_the_ramp(ramp_world):
    traversability, _, _, topology = ramp_world
    assert Label.STRAIGHT_RAMP in [node.label for node in topology.nodes.values()]
    assert nx.is_connected(topology.graph)
    for a, b in topology.graph.edges:
        way = topology.edge_path(a, b)
        assert np.isfinite(traversability.line_seconds(way[:-1], way[1:])).all()


def test_the_same_keyframe_again_adds_nothing(ramp_world):
    traversability, segments, patches, topology = ramp_world
    before = {n: node.position.tolist() for n, node in topology.nodes.items()}
    topology.update(patches, segments, PosePaths(traversability, (-1.5, 0)))
    assert {n: node.position.tolist() for n, node in topology.nodes.items()} == before


def test_plans_go_over_nodes_and_up_the_ramp_head_on(ramp_world):
    traversability, _, _, topology = ramp_world
    plan = plan_path(topology, PosePaths(traversability, (2.0, 1.2)), (2.5, 0.0))
    assert plan is not None
    way = np.vstack([[(2.0, 1.2)], plan.waypoints[:, :2]])
    assert np.isfinite(traversability.line_seconds(way[:-1], way[1:])).all()
    assert way[:, 0].min() < -0.2
    assert plan.waypoints[-1, 2] == pytest.approx(RISE, abs=0.01)
    assert plan.length == pytest.approx(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())


def test_no_plan_leads_into_a_wall_or_off_the_map(ramp_world):
    traversability, _, _, topology = ramp_world
    paths = PosePaths(traversability, (-1.5, 0))
    assert plan_path(topology, paths, (50.0, 0.0)) is None
    assert plan_path(topology, paths, (0.3, 0.62)) is None


def test_components_that_straight_drives_leave_apart_are_joined_around_the_wall():
    world = surface_of(ground_points(flat, (-2, 2), (-2, 2)), wall_points((0, -2), (0, 0.6)))
    traversability = assess_map(world)
    halves = [ground_points(flat, (-2, -0.3), (-2, 0)), ground_points(flat, (0.3, 2), (-2, 0))]
    patches = [patch(Label.TERRAIN, p, (0, 0, 5)) for p in halves]
    wall = patch(Label.WALL, wall_points((0, -2), (0, 0.6)), (-2, 0, 1))
    segments = Segments()
    segments.update([*patches, wall], 0, np.eye(4))
    topology = TopologicalMap()
    topology.update(patches, segments, PosePaths(traversability, (-1, -1)))
    assert len(topology.nodes) > 2
    assert nx.is_connected(topology.graph)


def test_all_ground_is_seen_by_few_nodes_that_can_turn():
    traversability, segments = room((-3, 3), (-2, 2), [((0, -2), (0, 0.8))])
    topology = topology_of(traversability, segments, (-2, 0))
    places = np.array([node.position for node in topology.nodes.values()])
    assert 3 <= len(places) <= 5
    assert traversability.grid.at(traversability.turnable, places).all()
    cells = traversability.grid.centre_of(np.argwhere(traversability.traversable))
    nearest = np.linalg.norm(cells[:, None] - places[None, :, :2], axis=-1).min(axis=1)
    assert np.quantile(nearest, 0.99) <= 2.0
    assert nx.is_connected(topology.graph)


def test_a_passage_too_narrow_to_turn_in_joins_two_rooms_and_keeps_doing_so():
    ends = [((x, side * 0.33), (x, side * 2)) for x in (0, 1) for side in (-1, 1)]
    tunnel = [*ends, ((0, -0.33), (1, -0.33)), ((0, 0.33), (1, 0.33))]
    traversability, segments = room((-3, 4), (-2, 2), tunnel)
    topology = topology_of(traversability, segments, (-2, 0))
    assert nx.is_connected(topology.graph)
    before = {n: node.position.tolist() for n, node in topology.nodes.items()}
    assert any(x > 1 for x, _, _ in before.values())
    topology.update([], segments, PosePaths(traversability, (-2, 0)))
    assert {n: node.position.tolist() for n, node in topology.nodes.items()} == before


def test_the_map_grows_with_the_ground_and_stays_few():
    whole, _ = room((-3, 9), (-2, 2), [((3, -2), (3, 0.8)), ((6, -0.8), (6, 2))])
    first, segments = room((-3, 3), (-2, 2), [])
    topology = topology_of(first, segments, (-2, 0))
    before = topology.nodes.copy()
    for x in (5, 7, 9):
        traversability, segments = room((-3, x), (-2, 2), [((3, -2), (3, 0.8)), ((6, -0.8), (6, 2))][: x // 3])
        topology.update([], segments, PosePaths(traversability, (-2, 0)))
        assert nx.is_connected(topology.graph)
    assert any(node is before.get(n) for n, node in topology.nodes.items())
    at_once = topology_of(whole, segments, (-2, 0))
    assert len(topology.nodes) <= len(at_once.nodes) + 2


def test_nodes_where_a_wall_turns_out_to_stand_move_away():
    traversability, segments = room((-3, 3), (-2, 2), [])
    topology = topology_of(traversability, segments, (-2, 0))
    x, y, _ = next(iter(topology.nodes.values())).position
    traversability, segments = room((-3, 3), (-2, 2), [((x - 0.5, y), (x + 0.5, y))])
    topology.update([], segments, PosePaths(traversability, (-2.5, -1.5)))
    for node in topology.nodes.values():
        assert traversability.grid.at(traversability.turnable, node.position)
    assert nx.is_connected(topology.graph)


def test_a_robot_that_stands_where_it_reaches_nothing_forgets_nothing():
    traversability, segments = room((-3, 3), (-2, 2), [])
    topology = topology_of(traversability, segments, (-2, 0))
    before = set(topology.nodes)
    topology.update([], segments, PosePaths(traversability, (30.0, 30.0)))
    assert set(topology.nodes) == before


def test_no_ground_no_nodes():
    traversability, segments = room((-3, 3), (-2, 2), [])
    topology = topology_of(traversability, segments, (30.0, 30.0))
    assert len(topology.nodes) == len(topology.graph) == 0


def test_the_file_holds_every_node_and_edge(ramp_world, tmp_path):
    topology = ramp_world[3]
    topology.save(tmp_path / "topology.json")
    content = json.loads((tmp_path / "topology.json").read_text())
    assert {n["id"] for n in content["nodes"]} == set(topology.nodes)
    assert len(content["edges"]) == topology.graph.number_of_edges()
    assert sum(edge["tree"] for edge in content["edges"]) == len(topology.nodes) - 1
    positions = {n["id"]: n["position"] for n in content["nodes"]}
    for edge in content["edges"]:
        assert [edge["way"][0], edge["way"][-1]] == [positions[n] for n in edge["nodes"]]
        parts = np.linalg.norm(np.diff(np.array(edge["way"])[:, :2], axis=0), axis=1)
        assert edge["length"] == pytest.approx(parts.sum(), abs=1e-3)


def test_nodes_of_keyframes_that_stay_do_not_move():
    ground, segments = room((-3, 3), (-2, 2), [((0, -2), (0, 0.8))])
    topology = topology_of(ground, segments, start=(-1.5, 0))
    poses, before = np.array([from_yaw(-1.5, 0, 0, 0), from_yaw(1.5, 0, 0, 0)]), dict(topology.nodes)
    topology.anchor(poses)
    topology.apply_poses(np.array([poses[0], from_yaw(1.6, 0, 0, 0)]), np.array([False, True]))
    stay = [n for n, node in before.items() if node.position[0] < 0]
    assert 0 < len(stay) < len(before)
    assert [n for n, node in before.items() if topology.nodes[n] is node] == stay


def test_nodes_move_with_the_map_under_their_ids():
    shift, offset = from_yaw(3.0, -2.0, 0, 0), np.array([3, -2, 0])
    before, segments = room((-3, 3), (-2, 2), [((0, -2), (0, 0.8))])
    topology = topology_of(before, segments, start=(-1.5, 0))
    old = {n: node.position for n, node in topology.nodes.items()}
    here = np.array([from_yaw(-1.5, 0, 0, 0)])
    topology.anchor(here)
    topology.apply_poses(shift @ here, np.array([True]))
    for n, position in old.items():
        np.testing.assert_allclose(topology.nodes[n].position, position + offset, atol=1e-9)
    segments.rebuild(shift[None])
    ground = surface_of(ground_points(flat, (0, 6), (-4, 0)), wall_points((3, -4), (3, -1.2)))
    ground.layers.match(before.grid)  # a map that is corrected never shrinks
    topology.update([], segments, PosePaths(assess_map(ground), (1.5, -2)))
    assert set(topology.nodes) == set(old)
    assert nx.is_connected(topology.tree)
    for a, b, edge in topology.tree.edges(data=True):
        assert edge["length"] >= np.linalg.norm((topology.nodes[a].position - topology.nodes[b].position)[:2]) - 1e-9
