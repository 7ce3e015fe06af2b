"""Finds places on an arena's walls for objects that can be viewed from drivable ground."""

from collections.abc import Callable, Iterator

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Direction, Place, Rotation3
from pipeline.labels import Label
from sarsim.ground_truth.true_surface import GroundTruthSurface, Survey
from sarsim.sensors.camera import geom_labels

SIGHT_HEIGHT = 0.5  # m, height above the ground at which walls are searched for; the camera is at 0.6 m
VIEWING_DISTANCE = 0.8
"""m, distance in front of a wall at which the robot must be able to stand; a lane of 1.2 m is wide enough."""
MAX_STEP = 0.05
"""m, maximum height difference between the ground in front of a wall and the ground from which the wall is found."""
MAX_POSITIONS, DIRECTION_COUNT = 2000, 8
"""Maximum number of drivable positions from which walls are searched for, and number of directions from each."""
WALL_REACH = 2.5  # m, maximum distance of a wall from the position from which it is found
FLATNESS_TOLERANCE = 0.001  # m by which a wall may deviate from a plane
_VISIBLE_GROUPS = np.array([1, 1, 1, 0, 0, 0], np.uint8)  # the visible geom groups


class Walls:
    """An arena's upright walls as seen from drivable ground."""

    def __init__(self, model: mujoco.MjModel, start: Place) -> None:
        """``start``: (3,) m, a point on the ground on which the robot drives."""
        self._model, self._data = model, mujoco.MjData(model)
        mujoco.mj_kinematics(model, self._data)
        self._is_wall = geom_labels(model) == Label.WALL
        self._surface: GroundTruthSurface = Survey(model, self._data).surface_from(start)

    def spread_places(
        self,
        rng: np.random.Generator,
        spacing: float,
        fits: Callable[[NDArray[np.float64], NDArray[np.float64]], bool],
    ) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Yield places on walls for which ``fits`` is true, each as far as possible from the earlier ones.

        A place is a point (3,) m at ``SIGHT_HEIGHT``, and the wall's normal (3,). The first place is random; all
        places are more than ``spacing`` m apart.
        """
        point, normal = self.hits(rng)
        to_others = np.full(len(point), np.inf)
        while len(point) and to_others.max() > spacing:
            farthest = int(to_others.argmax())
            if fits(point[farthest], normal[farthest]):
                yield point[farthest], normal[farthest]
                to_others = np.minimum(to_others, np.linalg.norm(point - point[farthest], axis=1))
            to_others[farthest] = 0.0

    def hits(self, rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(N, 3) m, points on walls at ``SIGHT_HEIGHT``, and (N, 3), the walls' normals there, in random order."""
        surface = self._surface
        cells = rng.permutation(np.argwhere(surface.drivable))[:MAX_POSITIONS]
        eyes = np.column_stack([surface.grid.centre_of(cells), surface.height[tuple(cells.T)] + SIGHT_HEIGHT])
        angles = rng.uniform(0, 2 * np.pi, (len(eyes), 1)) + np.arange(DIRECTION_COUNT) * 2 * np.pi / DIRECTION_COUNT
        rays = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=2)
        found = [self._cast(eye, ray) for eye, ray in zip(eyes, rays, strict=True)]
        return np.concatenate([f[0] for f in found]), np.concatenate([f[1] for f in found])

    def has_room(
        self, point: NDArray[np.float64], normal: NDArray[np.float64], half: float, rise: float = 0.0
    ) -> bool:
        """Whether the wall around a place is flat and not occluded, and the robot can stand in front of the place.

        ``point`` (3,) m and ``normal`` (3,) as from :meth:`hits`; the place is ``rise`` m above the point and extends
        ``half`` m in all directions.
        """
        eye, surface = point + VIEWING_DISTANCE * normal, self._surface
        step = surface.grid.at(surface.height, eye) + SIGHT_HEIGHT - eye[2]
        if not (surface.grid.at(surface.drivable, eye) and abs(step) < MAX_STEP):
            return False
        offsets = np.linspace(-half, half, 5)
        starts = (eye + a * rightward(normal) + [0.0, 0.0, rise + b] for a in offsets for b in offsets)
        return all(self._hits_squarely(start, -normal) for start in starts)

    def _cast(self, eye: NDArray[np.float64], rays: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """(M, 3) m, points where unit rays (N, 3) from ``eye`` (3,) m hit upright walls, and the normals (M, 3)."""
        count = len(rays)
        geom, distance, normal = np.full(count, -1, np.int32), np.full(count, -1.0), np.zeros((count, 3))
        flat = normal.ravel()
        mujoco.mj_multiRay(
            self._model, self._data, eye, rays.ravel(), _VISIBLE_GROUPS, 1, -1, geom, distance, flat, count,
            WALL_REACH,
        )  # fmt: skip
        met = (geom >= 0) & self._is_wall[geom] & (distance <= WALL_REACH) & (np.abs(normal[:, 2]) < 1e-6)
        return eye + rays[met] * distance[met, None], normal[met]

    def _hits_squarely(self, start: NDArray[np.float64], ray: NDArray[np.float64]) -> bool:
        """Whether a ray from a point hits a wall perpendicularly at distance ``VIEWING_DISTANCE``."""
        geom, normal = np.full(1, -1, np.int32), np.zeros(3)
        distance = mujoco.mj_ray(self._model, self._data, start, ray, _VISIBLE_GROUPS, 1, -1, geom, normal)
        is_square = abs(distance - VIEWING_DISTANCE) < FLATNESS_TOLERANCE and normal @ ray < -0.9999
        return bool(geom[0] >= 0 and self._is_wall[geom[0]] and is_square)


def rightward(normal: NDArray[np.float64]) -> Direction:
    """Unit vector (3,) to the right for a viewer who faces a wall with horizontal unit normal (3,)."""
    return np.array([-normal[1], normal[0], 0.0])


def wall_axes(normal: NDArray[np.float64]) -> Rotation3:
    """(3, 3) axes, as columns, of an object on a wall with horizontal normal (3,): right, up, towards the viewer."""
    return np.column_stack([rightward(normal), [0.0, 0.0, 1.0], normal])
