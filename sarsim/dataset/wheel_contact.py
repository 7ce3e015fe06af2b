"""The pose of a Pioneer 3-AT at rest on the ground, from the contacts of its wheels."""

import numpy as np

from pipeline.arrays import Pose
from pipeline.grid_map import Grid
from pipeline.transforms import from_rotation
from sarsim.dataset import wheel_contact_kernels as kernels
from sarsim.ground_truth.columns import ConvexBodies

AXLES = np.array([(0.135, 0.199, 0.111), (0.135, -0.199, 0.111), (-0.135, 0.199, 0.111), (-0.135, -0.199, 0.111)])
"""(4, 3) wheel centres in ``base_link``, m: front left, front right, rear left, rear right."""
RADIUS = 0.110  # m; a tyre with a radius of 0.111 m is compressed by 1 mm under the robot's weight
CENTRE_OF_MASS = np.array([0.005, 0.0, 0.149])  # (3,) m in ``base_link``
UNDERSIDE = np.array([(x, y, 0.08) for x in (-0.2, -0.1, 0.0, 0.1, 0.2) for y in (-0.1, 0.0, 0.1)])
"""(N, 3) lowest points of the chassis in ``base_link``, m."""
CONTACT_REACH = 0.2  # m; surfaces higher than this above the ground at the robot's centre do not count as ground


class WheelContact:
    """The contact of the robot's wheels with the ground of an arena."""

    def __init__(self, bodies: ConvexBodies, grid: Grid):
        """``bodies``: the arena without the robot; they are indexed by the cells of ``grid`` over which they lie."""
        number = np.arange(grid.shape[0] * grid.shape[1]).reshape(grid.shape)
        cells = [number[i0:i1, j0:j1].ravel() for i0, i1, j0, j1 in bodies.windows(grid)]
        cell, body = np.concatenate(cells), np.repeat(np.arange(len(cells)), [len(c) for c in cells])
        count = np.bincount(cell, minlength=number.size).reshape(grid.shape)
        start = count.cumsum().reshape(grid.shape) - count
        listed = body[np.argsort(cell, kind="stable")]
        self._ground = kernels.Ground(bodies.planes, bodies.first, start, count, listed, grid.origin, grid.cell)

    def stand(self, x: float, y: float, yaw: float, height: float) -> Pose | None:
        """Pose of ``base_link`` at rest at (x, y), m, with heading ``yaw``, rad, on rigid tyres.

        None if the robot cannot stand: a wheel has no ground below it, or the chassis would touch the ground.
        ``height``: height of the ground near (x, y), m.
        """
        below = height + CONTACT_REACH
        z, climb, rise = kernels.stand(self._ground, x, y, yaw, below, AXLES, RADIUS, CENTRE_OF_MASS)
        if not np.isfinite(z):
            return None
        R = kernels.attitude(yaw, climb, rise)
        if not kernels.is_clear(self._ground, x, y, z, R, below, UNDERSIDE):
            return None
        return from_rotation(R, (x, y, z))
