"""AprilTags on the walls of an arena, by which maps are scored, as at RoboCup Rescue."""

from collections.abc import Iterator
from itertools import islice

import cv2
import mujoco
import numpy as np
from dm_control import mjcf
from numpy.typing import NDArray

from pipeline.arrays import Pose, Poses
from pipeline.errors import InputError
from pipeline.labels import Label
from pipeline.transforms import from_rotation
from sarsim.arenas.arena import RescueArena
from sarsim.arenas.things.codes import RESERVED_TAGS, TAG_MODULES, TAG_SIDE, tag_picture
from sarsim.arenas.things.thing import data_of
from sarsim.arenas.walls import Walls, wall_axes

TAG_THICKNESS = 0.001  # m, thickness of a tag, which a depth camera cannot resolve
TAG_SPACING = 0.5  # m, minimum distance between tags


def hang_fiducials(arena: RescueArena, number: int, seed: int) -> Poses:
    """Hang tags 0 to ``number`` - 1 on walls in front of drivable ground, each as far from the others as possible.

    A tag is labelled as wall and does not collide. It is an object to find, of kind april_tag.

    Returns:
        (number, 4, 4) poses T_world_tag: origin at the tag's centre; x right, y up and z towards the viewer.

    Raises:
        InputError: the number is below 0 or above ``RESERVED_TAGS``, or there is not enough room on the walls.
    """
    if not 0 <= number <= RESERVED_TAGS:
        raise InputError(f"--fiducials {number}: must be from 0 to {RESERVED_TAGS}")
    with arena.prefixing_errors():
        poses = list(_tag_poses(arena, number, np.random.default_rng(seed))) if number else []
    if len(poses) < number:
        raise InputError(f"--fiducials {number}: the arena's walls have room for only {len(poses)}")
    for tag, T in enumerate(poses):
        _hang(arena.mjcf_model, tag, T)
    return np.array(poses).reshape(-1, 4, 4)


def _hang(root: mjcf.RootElement, tag: int, T: Pose) -> None:
    name, half = f"fiducial_{tag}", TAG_SIDE / TAG_MODULES * (TAG_MODULES / 2 + 1)
    png = cv2.imencode(".png", cv2.cvtColor(tag_picture(tag), cv2.COLOR_GRAY2BGR))[1].tobytes()
    texture = root.asset.add("texture", name=name, type="2d", file=mjcf.Asset(png, ".png"))
    material = root.asset.add("material", name=name, texture=texture, texuniform=False, specular=0)
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, T[:3, :3].ravel())
    body = root.worldbody.add("body", name=name, pos=T[:3, 3], quat=quat)
    body.add(
        "geom", name=name, type="box", size=(half, half, TAG_THICKNESS / 2), pos=(0, 0, -TAG_THICKNESS / 2),
        material=material, rgba=(1, 1, 1, 1), user=(float(Label.WALL),), contype=0, conaffinity=0,
    )  # fmt: skip
    root.custom.add("text", name=name, data=data_of("april_tag", str(tag)))


def _tag_poses(arena: RescueArena, number: int, rng: np.random.Generator) -> Iterator[NDArray[np.float64]]:
    """At most ``number`` 4×4 tag poses: a random first pose, and poses as far as possible from all earlier ones."""
    root = arena.mjcf_model
    model = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    walls, half = Walls(model, arena.T_world_start[:3, 3]), TAG_SIDE / TAG_MODULES * (TAG_MODULES / 2 + 2)
    places = walls.spread_places(rng, TAG_SPACING, lambda point, normal: walls.has_room(point, normal, half))
    for point, normal in islice(places, number):
        yield from_rotation(wall_axes(normal), point + normal * TAG_THICKNESS)
