"""AprilTags on the walls of an arena, with which maps are scored as at RoboCup Rescue."""

from collections.abc import Iterator

import cv2
import mujoco
import numpy as np
from dm_control import mjcf
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.labels import Label
from pipeline.transforms import from_rotation
from sarsim.arenas.arena import RescueArena
from sarsim.ground_truth.true_surface import Survey, TrueSurface
from sarsim.sensors.camera import geom_labels

FAMILY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
TAG_SIDE = 0.16  # m of the black square, 8 modules
MODULES = 8
MOST_TAGS = 50  # Largest number of tags in an arena
THICK = 0.001  # m; a camera does not see the step
TAG_HEIGHT = 0.5  # m of a tag's centre above the ground in front of it; the camera is at 0.6 m
STAND = 0.8  # m in front of a tag, where the robot must be able to stand; a lane of 1.2 m is wide enough
MAX_STEP = 0.05  # m, largest height difference between the ground there and the ground from which the wall was found
TAG_SPACING = 0.5  # m, least distance between tags
PLACES, DIRECTIONS = 2000, 8
"""Largest number of drivable places from which walls are searched for, and number of directions from each."""
TAG_REACH = 2.5  # m, largest distance of these walls
_SEEN = np.array([1, 1, 1, 0, 0, 0], np.uint8)  # the visible groups of geoms


def hang_fiducials(arena: RescueArena, number: int, seed: int) -> NDArray[np.float64]:
    """Hang tags 0 to ``number`` - 1 on walls in front of drivable ground, each as far from the others as possible.

    A tag is labelled as wall, and collides with nothing.

    Returns:
        (number, 4, 4) poses T_world_tag: origin at its centre, x right and y up for a viewer, z towards the viewer.

    Raises:
        InputError: a number below 0 or above ``MOST``, or the walls have no room for so many.
    """
    if not 0 <= number <= MOST_TAGS:
        raise InputError(f"--fiducials {number}: 0 to {MOST_TAGS}")
    poses = list(_poses(arena, number, np.random.default_rng(seed))) if number else []
    if len(poses) < number:
        raise InputError(f"--fiducials {number}: the arena's walls have room for {len(poses)}")
    for tag, T in enumerate(poses):
        _hang(arena.mjcf_model, tag, T)
    return np.array(poses).reshape(-1, 4, 4)


def picture(tag: int, module: int = 16) -> NDArray[np.uint8]:
    """(H, H) uint8 image of a tag with a white margin of one module; a module has ``module`` pixels."""
    black = cv2.aruco.generateImageMarker(FAMILY, tag, MODULES * module)
    return np.pad(black, module, constant_values=255)


def _hang(root: mjcf.RootElement, tag: int, T: NDArray[np.float64]) -> None:
    name, half = f"fiducial_{tag}", TAG_SIDE / MODULES * (MODULES / 2 + 1)
    png = cv2.imencode(".png", cv2.cvtColor(picture(tag), cv2.COLOR_GRAY2BGR))[1].tobytes()
    texture = root.asset.add("texture", name=name, type="2d", file=mjcf.Asset(png, ".png"))
    material = root.asset.add("material", name=name, texture=texture, texuniform=False, specular=0)
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, T[:3, :3].ravel())
    root.worldbody.add(
        "geom", name=name, type="box", size=(half, half, THICK / 2), pos=T[:3, 3] - T[:3, 2] * THICK / 2, quat=quat,
        material=material, rgba=(1, 1, 1, 1), user=(float(Label.WALL),), contype=0, conaffinity=0,
    )  # fmt: skip


def _poses(arena: RescueArena, number: int, rng: np.random.Generator) -> Iterator[NDArray[np.float64]]:
    """At most ``number`` poses of tags: the first at random, each next one the farthest from those before."""
    root = arena.mjcf_model
    model = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    walls = _Walls(model, arena.T_world_start[:3, 3])
    point, normal = walls.hits(rng)
    to_others = np.full(len(point), np.inf)
    while number and len(point) and to_others.max() > TAG_SPACING:
        farthest = int(to_others.argmax())
        if walls.has_room(point[farthest], normal[farthest]):
            R = np.column_stack([_along(normal[farthest]), [0.0, 0.0, 1.0], normal[farthest]])
            yield from_rotation(R, point[farthest] + normal[farthest] * THICK)
            number -= 1
            to_others = np.minimum(to_others, np.linalg.norm(point - point[farthest], axis=1))
        to_others[farthest] = 0.0


def _along(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) direction to the right for a viewer who faces a wall with this horizontal normal (3,)."""
    return np.array([-normal[1], normal[0], 0.0])


class _Walls:
    """An arena's upright walls as seen from drivable ground."""

    def __init__(self, model: mujoco.MjModel, start: NDArray[np.float64]) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        mujoco.mj_kinematics(model, self._data)
        self._is_wall = geom_labels(model) == Label.WALL
        self._surface: TrueSurface = Survey(model, self._data).surface_from(start)

    def hits(self, rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(N, 3) points on walls at the height of tags, m, and their normals (N, 3), in random order."""
        surface = self._surface
        cells = rng.permutation(np.argwhere(surface.drivable))[:PLACES]
        eyes = np.column_stack([surface.grid.centre_of(cells), surface.height[tuple(cells.T)] + TAG_HEIGHT])
        angles = rng.uniform(0, 2 * np.pi, (len(eyes), 1)) + np.arange(DIRECTIONS) * 2 * np.pi / DIRECTIONS
        rays = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=2)
        found = [self._cast(eye, ray) for eye, ray in zip(eyes, rays, strict=True)]
        return np.concatenate([f[0] for f in found]), np.concatenate([f[1] for f in found])

    def _cast(self, eye: NDArray[np.float64], rays: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Points where rays (N, 3) of length 1 from a point (3,) hit upright walls, and the normals there."""
        count = len(rays)
        geom, distance, normal = np.full(count, -1, np.int32), np.full(count, -1.0), np.zeros((count, 3))
        flat = normal.ravel()
        mujoco.mj_multiRay(
            self._model, self._data, eye, rays.ravel(), _SEEN, 1, -1, geom, distance, flat, count, TAG_REACH
        )  # fmt: skip
        met = (geom >= 0) & self._is_wall[geom] & (distance <= TAG_REACH) & (np.abs(normal[:, 2]) < 1e-6)
        return eye + rays[met] * distance[met, None], normal[met]

    def has_room(self, point: NDArray[np.float64], normal: NDArray[np.float64]) -> bool:
        """Whether the wall behind a tag would be flat, nothing occludes the tag, and the robot can stand there."""
        eye, surface = point + STAND * normal, self._surface
        step = surface.grid.at(surface.height, eye) + TAG_HEIGHT - eye[2]
        if not (surface.grid.at(surface.drivable, eye) and abs(step) < MAX_STEP):
            return False
        half = TAG_SIDE / MODULES * (MODULES / 2 + 2)
        offsets = np.linspace(-half, half, 5)
        starts = (eye + a * _along(normal) + [0.0, 0.0, b] for a in offsets for b in offsets)
        return all(self._meets(start, -normal) for start in starts)

    def _meets(self, start: NDArray[np.float64], ray: NDArray[np.float64]) -> bool:
        """Whether a ray from a point hits a wall perpendicularly at a distance of ``STAND`` m."""
        geom, normal = np.full(1, -1, np.int32), np.zeros(3)
        distance = mujoco.mj_ray(self._model, self._data, start, ray, _SEEN, 1, -1, geom, normal)
        is_square = abs(distance - STAND) < THICK and normal @ ray < -0.9999
        return bool(geom[0] >= 0 and self._is_wall[geom[0]] and is_square)
