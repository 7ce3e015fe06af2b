"""Nodes and the straight drives between them."""

import numpy as np

from pipeline.labels import Label
from pipeline.topological_map.config import TopologicalMapConfig
from pipeline.topological_map.node_set import NodeSet
from tests.pipeline.topological_map.grounds import U_TURN, room


def test_the_drives_of_a_moved_node_are_tested_again_wherever_it_lies_in_its_cell() -> None:
    traversability, segments = room((-3, 3), (-2, 2), U_TURN)
    ground = traversability, traversability.traversable, list(segments)
    for x in (1.005, 1.045):  # both sides of the middle of a cell
        nodes = NodeSet(TopologicalMapConfig())
        nodes.renew(*ground)
        west, east = (nodes.add(Label.TERRAIN, np.array(xy)) for xy in ((-1.2, 1.2), (x, 1.4)))
        assert nodes.drive_graph.has_edge(west, east)
        nodes.move_to(np.array([[-1.2, 1.2, 0.0], [x, -1.0, 0.0]]), np.array([False, True]))
        nodes.renew(*ground)
        assert not nodes.drive_graph.has_edge(west, east)  # the wall lies between them
