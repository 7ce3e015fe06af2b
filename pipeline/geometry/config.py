"""Parameters of the geometry that several packages share."""

from dataclasses import dataclass


@dataclass(frozen=True)
class CellConfig:
    """The cells that show where a surface is inside its bounding box.

    Attributes:
        edge: edge length, m. Centres lie at multiples of it, as floors and walls tend to: noise would spread a
            surface on the face between two cells over both.
        reach: maximum distance between neighbouring cells along every axis, cells. With 2, gaps of 0.15 m always
            divide a surface, and gaps of 0.05 m never do.
        frayed: a cell with less than this share of a neighbour's points is noise at the surface's edge.
    """

    edge: float = 0.05
    reach: int = 2
    frayed: float = 0.25

    @property
    def front(self) -> int:
        """Minimum number of cells near another set for both to be one surface: one more than at a corner."""
        return (self.reach + 1) ** 2 + 1
