"""Generate ``assets/victims/people.npz``: bodies, and the poses in which they came to rest."""

import sys
from itertools import islice
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, indent

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.files import atomic_write
from sarsim.assets import asset
from sarsim.commands.cli import run
from sarsim.victims.people import UNIT, bone_motions, skinned
from sarsim.victims.victims import make_victim

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # scripts/ is not installed
from scripts.assets.victims.parts import cut_into_parts
from scripts.assets.victims.ragdoll import RECIPES, SEAT_BLOCK, Ragdoll, Setup, rest_poses
from scripts.assets.victims.surface import (
    HEAD_SCALE,
    Points,
    body_surface,
    fitted,
    hair,
    level_set,
    person,
    scaled_head,
)

COUNTS = {
    "lying": {"man": 4, "woman": 2, "stout": 1, "child": 2},
    "straight": {"woman": 2},
    "prone": {"man": 2, "woman": 2, "stout": 1, "child": 2},
    "side": {"man": 2, "woman": 2, "child": 1},
    "sitting": {"man": 3, "woman": 3, "stout": 1, "child": 3},
    "slumped": {"man": 2, "woman": 2, "stout": 1, "child": 1},
    "seated": {"man": 1, "woman": 1, "child": 1},
}
"""Number of poses for each recipe and build."""
HAIR = {"short": 300, "long": 400}  # Number of triangles of each hair style
TRIANGLES = 3600
TRIES = 150
SUNK = 0.004  # Depth by which the body sinks into the floor or the wall, because flesh yields, m


LIBRARY = asset("victims", "people.npz")


def make_victims(seed: int = 0, out: Path = LIBRARY) -> None:
    """Model the bodies, let them fall, and write the library.

    Args:
        seed: seed of all falls.
        out: file to write.
    """
    people = bodies()
    rng = np.random.default_rng(seed)
    poses, postures, builds = [], [], []
    for recipe, counts in COUNTS.items():
        for build, count in counts.items():
            ragdoll = Ragdoll(person(build), RECIPES[recipe])
            falls = (ragdoll.bone_poses for _ in range(TRIES) if ragdoll.fall(rng))
            found = list(islice(falls, count))
            print(f"{recipe} {build}: {len(found)} of {count}")
            poses += [set_down(people, build, pose, RECIPES[recipe]) for pose in found]
            postures += ["lying" if recipe == "straight" else recipe] * len(found)
            builds += [build] * len(found)
    people |= {"poses": np.array(poses, np.float32), "postures": np.array(postures), "builds": np.array(builds)}
    with atomic_write(out) as path, path.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **people)
    print(f"{out}: {out.stat().st_size / 1e3:.0f} kB")
    write_arena_victims(asset("arenas", "nist_6x4_victims.xml"))


def bodies() -> dict[str, NDArray]:
    """All arrays of the library except ``poses``, ``postures`` and ``builds``."""
    body, face_parts, parts = cut_into_parts(body_surface(person("man"), TRIANGLES))
    head = body.weights[:, body.bones.index("head")]
    surfaces = [fitted(person(b), scaled_head(body.vertices, head, s)) for b, s in HEAD_SCALE.items()]
    arrays = {
        "bones": np.array(body.bones),
        "rest": rest_poses(body.bones).astype(np.float32),
        "weights": np.round(body.weights * 255).astype(np.uint8),
        "build_names": np.array(list(HEAD_SCALE)),
        "head_scales": np.array(list(HEAD_SCALE.values())),
        "vertices": _whole(np.array(surfaces)),
        "faces": body.faces.astype(np.uint16),
        "face_parts": face_parts.astype(np.uint8),
        "parts": np.array(parts),
        "hair_styles": np.array(list(HAIR)),
        "block": np.array(SEAT_BLOCK),
    }
    for style, triangles in HAIR.items():
        vertices, faces = level_set(hair(style), triangles)
        arrays |= {f"{style}_hair_vertices": _whole(vertices), f"{style}_hair_faces": faces.astype(np.uint16)}
    return arrays


def set_down(people: dict[str, NDArray], build: str, pose: NDArray[np.float64], recipe: Setup) -> NDArray[np.float64]:
    """The pose in the victim's frame: centred with the head towards +x, or with the back against a wall at x = 0."""
    if recipe.block:
        return pose  # wall and block are already in place
    if not recipe.wall:
        root, head = (list(people["bones"]).index(name) for name in ("root", "head"))
        towards_head = pose[head, :2] - pose[root, :2]
        yaw = -np.arctan2(towards_head[1], towards_head[0])
        pose = _moved(pose, Rotation.from_euler("z", yaw), np.zeros(3))
    turns, offsets = bone_motions(people["rest"], pose)
    vertices = people["vertices"][list(HEAD_SCALE).index(build)] * UNIT
    vertices = skinned(vertices, people["weights"], turns, offsets)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    place = (low + high) / 2
    if recipe.wall:
        place[0] = low[0] + SUNK
    place[2] = low[2] + SUNK
    return _moved(pose, Rotation.identity(), -place)


def _moved(pose: NDArray[np.float64], turn: Rotation, shift: NDArray[np.float64]) -> NDArray[np.float64]:
    quat = (turn * Rotation.from_quat(pose[:, [4, 5, 6, 3]])).as_quat()
    return np.concatenate([turn.apply(pose[:, :3]) + shift, quat[:, [3, 0, 1, 2]]], axis=1)


def _whole(metres: Points) -> NDArray[np.int16]:
    return np.round(metres / UNIT).astype(np.int16)


def write_arena_victims(out: Path) -> None:
    """Write the victims of ``nist_6x4``: a child lying along the north wall, a small woman sitting in a corner."""
    root = Element("mujocoinclude")
    lying = make_victim("lying", np.random.default_rng(1), "lying", stature=1.1, room=(1.3, 0.5))
    lying.add_to(root, (-0.4, 1.995 - lying.footprint[1, 1], 0), np.pi)
    sitting = make_victim("sitting", np.random.default_rng(2), "sitting", stature=1.45, room=(0.66, 0.67))
    sitting.add_to(root, (2.995 - sitting.footprint[1, 1], -2, 0), np.pi / 2)
    indent(root)
    with atomic_write(out) as path:
        ElementTree(root).write(path)


if __name__ == "__main__":
    run(make_victims)
