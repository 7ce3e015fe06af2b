"""Draw docs/images/episode.webp: an episode seen from above, with the labels that the robot gives, and by its camera.

``python docs/figures/draw_animation.py runs/nist_6x4-0`` takes the episode's keyframes.npz.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

from pipeline.arrays import PixelMask
from pipeline.frame import Frame
from pipeline.keyframes import Seen
from pipeline.labels import COLOURS, Label
from pipeline.map_file import load_keyframes
from pipeline.mapper import Mapper
from sarsim.arenas.load import load_arena
from sarsim.composition import TRUE_LABELS, make_mapper
from sarsim.sensors.camera import geom_labels
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig

FRAMES, SHOWN, LAST = 80, 130, 3000
"""Largest number of images; ms that each is shown, and the last one."""
OVERVIEW, VIEW = (640, 480), (266, 200)
"""Pixels of the picture from above, and of each of the robot's images right of it."""
CUT = 40, 440
"""Rows of the picture from above that show something."""
BEHIND = 0.03
"""m that a point may lie behind the surface of the picture, and still be painted on it."""
PAINT = 0.85
"""Opacity of a label's colour."""
QUALITY = 70
IMAGE = Path(__file__).parents[1] / "images" / "episode.webp"


def main() -> None:
    robot = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(), seed=0)
    mapper = make_mapper(TRUE_LABELS, robot.model)
    load_keyframes(Path(sys.argv[1]) / "keyframes.npz", mapper)
    first, *others = [Image.fromarray(picture) for picture in growing(mapper, robot)]
    durations = [SHOWN] * len(others) + [LAST]
    first.save(IMAGE, save_all=True, append_images=others, duration=durations, loop=0, quality=QUALITY, method=4)
    print(f"{IMAGE}: {1 + len(others)} pictures, {IMAGE.stat().st_size / 1e6:.2f} MB")
    robot.close()


def growing(mapper: Mapper, robot: SimulatedRobot) -> Iterator[NDArray[np.uint8]]:
    """(H, W, 3) uint8 images after every n-th keyframe and the last one."""
    keyframes = mapper.keyframes
    clouds = [labelled(seen, T) for seen, T in zip(keyframes.seen, keyframes.poses, strict=True)]
    every = 1 + len(clouds) // FRAMES
    for k in sorted({*range(0, len(clouds), every), len(clouds) - 1}):
        T = keyframes.poses[k]
        robot.robot.set_pose(robot.physics, T[:3, 3], np.roll(Rotation.from_matrix(T[:3, :3]).as_quat(), 1))
        robot.physics.forward()
        points, colours = (np.concatenate(parts) for parts in zip(*clouds[: k + 1], strict=True))
        yield beside(painted(robot, points, colours), robot.sense())


def labelled(seen: Seen, T: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """(N, 3) points in ``map``, m, without the ceiling, and their colours (N, 3); none if it was not labelled."""
    if seen.shares is None:
        return np.zeros((0, 3)), np.zeros((0, 3), np.uint8)
    labels = seen.shares.classes[:, 0]
    kept = labels != Label.CEILING
    return seen.points_at(T)[kept], COLOURS[labels[kept]]


def painted(robot: SimulatedRobot, points: NDArray[np.float64], colours: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(H, W, 3) the arena from above, with the points that are in sight painted on it."""
    data = robot.physics.data.ptr
    picture = cv2.resize(robot.renderer.colour(data, "overview"), OVERVIEW)
    geoms, depth = (
        cv2.resize(image, OVERVIEW, interpolation=cv2.INTER_NEAREST)
        for image in robot.renderer.segmentation_and_depth(data, "overview")
    )
    view = robot.physics.named
    in_camera = (points - view.data.cam_xpos["overview"]) @ view.data.cam_xmat["overview"].reshape(3, 3)
    focal = OVERVIEW[1] / 2 / np.tan(np.radians(view.model.cam_fovy["overview"]) / 2)
    uv = (in_camera[:, :2] * (1, -1) / -in_camera[:, 2:] * focal + np.array(OVERVIEW) / 2).astype(int)
    layer = np.zeros_like(picture)
    for step in ((0, 0), (1, 0), (0, 1), (1, 1), (-1, 0), (0, -1)):
        u, v = (uv + step).clip(0, np.array(OVERVIEW) - 1).T
        in_sight = -in_camera[:, 2] < depth[v, u] + BEHIND
        layer[v[in_sight], u[in_sight]] = colours[in_sight]
    people = geom_labels(robot.physics.model.ptr)[geoms] == Label.VICTIM
    layer[seen_pieces(people & (geoms >= 0), layer.any(axis=2))] = COLOURS[Label.VICTIM]
    opacity = PAINT * layer.any(axis=2, keepdims=True)
    return (picture * (1 - opacity) + layer * opacity).astype(np.uint8)


def seen_pieces(mask: PixelMask, painted: PixelMask) -> PixelMask:
    """The connected pieces of a mask in which a pixel is painted, for people of whom the robot has seen a part."""
    pieces = cv2.connectedComponents(mask.astype(np.uint8))[1]
    return mask & np.isin(pieces, pieces[painted & mask])


def beside(picture: NDArray[np.uint8], frame: Frame) -> NDArray[np.uint8]:
    """The picture from above, and right of it what the robot's camera sees: colour, and depth below."""
    picture = picture[slice(*CUT)]
    near = np.where(frame.returns, 255 - 200 * (frame.depth / frame.sensor.farthest), 0).astype(np.uint8)
    images = [cv2.resize(image, VIEW, interpolation=cv2.INTER_AREA) for image in (frame.rgb, cv2.merge([near] * 3))]
    return np.hstack([picture, np.vstack(images)])


if __name__ == "__main__":
    main()
