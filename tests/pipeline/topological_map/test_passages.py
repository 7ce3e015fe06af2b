"""Passages: ways with bends between nodes, as long as nothing blocks them."""

import networkx as nx
import numpy as np

from pipeline.labels import Label
from pipeline.topological_map.node_set import Node, StraightDrives
from pipeline.topological_map.passages import Passages
from tests.pipeline.topological_map.grounds import U_TURN, room


def test_a_passage_ends_when_something_stands_in_the_middle_of_one_of_its_drives():
    nodes = {k: Node(k, Label.TERRAIN, np.array([x, -1.5, 0.0])) for k, x in enumerate((-2.5, 2.5))}
    passages, before = Passages(2.0), np.bool_(True)
    for block in ([], [((-1.3, -0.3), (-1.2, -0.1))]):
        traversability, _ = room((-3, 3), (-2, 2), [*U_TURN, *block])
        changed, before, drives = traversability.hazard != before, traversability.hazard, nx.Graph()
        passages.renew(nodes, StraightDrives(traversability, []), drives, changed)
        passages.add_to(drives)
        assert drives.has_edge(0, 1) == (not block)
