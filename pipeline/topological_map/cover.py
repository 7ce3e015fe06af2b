"""The ground that nodes must see, the cells that they see, the walls that hide cells, and candidates for nodes."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.arrays import Cells, Indices, Mask, MaskLayer, Place, Places
from pipeline.elevation_map.traversability import Traversability
from pipeline.geometry.sight import visible_cells
from pipeline.grid_map import CellWindow, Grid, GridMap, LayerType, best_of_blocks, box_around
from pipeline.segments.segment import Segment
from pipeline.topological_map import cover_kernels as kernels
from pipeline.topological_map.config import TopologicalMapConfig

BLOCK = 4
"""Side of a block that contributes one candidate for a node, cells."""


@dataclass(frozen=True, eq=False)
class VisibleCells:
    """The cells that are seen from K positions.

    Attributes:
        places: (K, 2) positions, m.
        seen: (K, S, S) which cells of a square window around each position are seen.
        corners: (K, 2) absolute indices of the windows' first cells.
    """

    places: Places
    seen: NDArray[np.bool_]
    corners: Cells


class NodeCover:
    """A grid map of the ground that nodes must see, with the number of nodes that see each cell.

    Attributes:
        traversability: where the robot may drive, as of the last update.
    """

    traversability: Traversability

    def __init__(self, config: TopologicalMapConfig) -> None:
        self._config = config
        self._seen_by: dict[int, VisibleCells] = {}

    @cached_property
    def _layers(self) -> GridMap:
        """The layers, created with the first ground, which determines the size of the cells."""
        mask = LayerType(np.bool_)
        counts, unworthy = LayerType(np.int32, in_place=True), LayerType(np.bool_, in_place=True)
        kinds = {"target": mask, "standable": mask, "walls": mask, "view_counts": counts, "unworthy": unworthy}
        return GridMap(self.traversability.grid.cell, kinds)

    @property
    def _reach(self) -> int:
        """Maximum distance at which a node sees ground, cells."""
        return round(self._config.sight / self.grid.cell)

    def update(self, traversability: Traversability, reachable: MaskLayer, walls: Sequence[Segment]) -> MaskLayer:
        """Update the layers; a node's view is recomputed only if a cell in its window changed.

        Args:
            traversability: where the robot may drive.
            reachable: cells that the robot can reach, which nodes must see.
            walls: segments that hide the ground behind them, as tall hazards do.

        Returns:
            The cells that changed.
        """
        self.traversability = traversability
        layers = self._layers
        revision = layers.revision
        layers.match(traversability.grid)
        layers.write("target", traversability.traversable & reachable)
        layers.write("standable", traversability.turnable & reachable)
        in_walls = np.vstack([np.zeros((0, 3)), *(wall.tree.data for wall in walls)])
        layers.write("walls", traversability.tall | self.grid.mask_of(in_walls))
        changed = layers.changed_since(revision)
        if changed.any():
            layers["unworthy"][box_around(changed, 2 * self._reach)] = False
        for node, visible in list(self._seen_by.items()):
            if changed[self._window(visible)].any():
                self.remove(node)
                self.add(node, visible.places[0])
        return changed

    @property
    def grid(self) -> Grid:
        """The grid of the layers."""
        return self._layers.grid

    @property
    def target(self) -> MaskLayer:
        """Traversable cells that the robot can reach, which nodes must see."""
        return self._layers["target"]

    @property
    def standable(self) -> MaskLayer:
        """Cells that the robot can reach and where it can turn."""
        return self._layers["standable"]

    @property
    def view_counts(self) -> NDArray[np.int32]:
        """(nx, ny) number of nodes that see each target cell."""
        return self._layers["view_counts"]

    @property
    def missing(self) -> MaskLayer:
        """Target cells that no node sees."""
        return self.target & (self.view_counts == 0)

    @property
    def wanted(self) -> MaskLayer:
        """Missing cells, except cells marked as not worth a node since the ground around them last changed."""
        return self.missing & ~self._layers["unworthy"]

    def mark_missing_as_unworthy(self) -> None:
        """Mark the cells that no node sees as not worth a node."""
        self._layers["unworthy"][:] = self.missing

    def visible_from(self, places: Places) -> VisibleCells:
        """The cells that are seen from (K, 2) positions, m."""
        cells = self.grid.cell_of(places)
        reach = self._reach
        seen = visible_cells(cells, self.target, self._layers["walls"], reach)
        return VisibleCells(places, seen, cells - reach + self.grid.low)

    def add(self, node: int, place: Place) -> None:
        """Count the cells that a new node at ``place``, (2,) m, sees."""
        self._seen_by[node] = self.visible_from(place[None])
        self._add_to_counts(node, 1)

    def remove(self, node: int) -> None:
        """Remove a node, and no longer count the cells that it sees."""
        self._add_to_counts(node, -1)
        del self._seen_by[node]

    def gains(self, visible: VisibleCells) -> Indices:
        """(K,) number of missing cells that are seen from each of the positions."""
        return kernels.count_in(visible.seen, visible.corners - self.grid.low, self.missing)

    def lost_without(self, nodes: Collection[int]) -> Cells:
        """(N, 2) cells that only the given nodes see, outermost first."""
        seen = np.concatenate([self._seen_by[n].seen for n in nodes])
        corners = np.concatenate([self._seen_by[n].corners for n in nodes]) - self.grid.low
        cells = kernels.only_seen_by(seen, corners, self.view_counts)
        if not len(cells):
            return cells
        return cells[np.argsort(-np.linalg.norm(cells - cells.mean(axis=0), axis=1), kind="stable")]

    def see_all(self, visible: VisibleCells, cells: Cells, spare: int) -> Mask:
        """(K,) whether all of the cells (N, 2), except at most ``spare``, are seen from each of the positions."""
        return kernels.see_all(visible.seen, visible.corners - self.grid.low, cells, spare)

    def is_near(self, node: int, mask: MaskLayer) -> bool:
        """Whether any cell of a mask lies in a node's window."""
        return bool(mask[self._window(self._seen_by[node])].any())

    def candidates(self, mask: MaskLayer, within: float, min_cells: int = 1) -> Places:
        """(K, 2) m, candidates for nodes: in each block of cells, the standable cell that is farthest from hazards.

        Candidates lie within ``within`` m of the mask. The square around a candidate, ``within`` m to each side,
        contains at least ``min_cells`` cells of the mask.
        """
        if not mask.any():
            return np.zeros((0, 2))
        # Start the window at the corner of a block.
        cell = self.grid.cell
        reach = round(within / cell)
        i, j = box_around(mask, reach)
        window = slice(i.start // BLOCK * BLOCK, i.stop), slice(j.start // BLOCK * BLOCK, j.stop)
        near = ndimage.distance_transform_edt(~mask[window]) * cell <= within
        if min_cells > 1:
            share = ndimage.uniform_filter(mask[window].astype(np.float32), 2 * reach + 1, mode="constant")
            near &= share * (2 * reach + 1) ** 2 > min_cells - 0.5
        room = np.where(near & self.standable[window], self.traversability.to_hazard[window], 0)
        corner = np.array([side.start for side in window])
        return self.grid.centre_of(corner + best_of_blocks(room, BLOCK))

    def _add_to_counts(self, node: int, by: int) -> None:
        """Add ``by`` to the counts of the cells that a node sees."""
        visible = self._seen_by[node]
        window = self._window(visible)
        corner = visible.corners[0] - self.grid.low
        i, j = (slice(w.start - c, w.stop - c) for w, c in zip(window, corner, strict=True))
        self.view_counts[window] += by * visible.seen[0][i, j]

    def _window(self, visible: VisibleCells) -> CellWindow:
        """The part of the first position's window that lies on the grid."""
        corner = visible.corners[0] - self.grid.low
        low = np.maximum(corner, 0)
        high = np.maximum(np.minimum(corner + 2 * self._reach + 1, self.grid.shape), low)
        return slice(int(low[0]), int(high[0])), slice(int(low[1]), int(high[1]))
