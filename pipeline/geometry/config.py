"""Numbers of the geometry that several rooms share."""

from dataclasses import dataclass


@dataclass(frozen=True)
class CellConfig:
    """The cells that show where inside its bounding box a surface is.

    Attributes:
        edge: m. Centres lie at its multiples: there floors and walls tend to lie, and noise would spread one on the
            face between two cells over both.
        reach: cells up to this far apart along every axis are neighbours: with 2, gaps of 0.15 m always part a
            surface, gaps of 0.05 m never do.
        frayed: a cell with less than this share of the points of another neighbour is noise at the surface's edge.
    """

    edge: float = 0.05
    reach: int = 2
    frayed: float = 0.25

    @property
    def front(self) -> int:
        """Least number of cells of a set near another set that make both one surface: one more than at a corner."""
        return (self.reach + 1) ** 2 + 1
