"""Draw docs/images/episode.gif: the growing labelled map of an episode, and the depth image of every keyframe.

``python docs/figures/draw_animation.py runs/nist_6x4-0`` takes the episode's keyframes.npz.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pipeline.keyframes import Seen
from pipeline.labels import COLOURS, Label
from pipeline.map_file import load_keyframes
from pipeline.mapper import Mapper
from pipeline.semantic_map.classifier import TruthClassifier
from sarsim.robots.model import robot_model

PIXELS = 90
"""Pixels per metre."""
MARGIN = 0.3
"""m around the map."""
FRAMES, SHOWN, LAST = 70, 160, 3000
"""Largest number of images; ms that each is shown, and the last one."""
DEPTH = 256, 192
"""Pixels of the depth image."""
COLOURS_LEFT = 40
BACKGROUND, WAY, ROBOT = 250, (90, 90, 90), (20, 20, 20)
IMAGE = Path(__file__).parents[1] / "images" / "episode.gif"


def main() -> None:
    mapper = Mapper(robot_model(), TruthClassifier())
    load_keyframes(Path(sys.argv[1]) / "keyframes.npz", mapper)
    pictures = [Image.fromarray(picture) for picture in growing(mapper)]
    palette = pictures[-1].quantize(COLOURS_LEFT, dither=Image.Dither.NONE)
    first, *others = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    durations = [SHOWN] * len(others) + [LAST]
    first.save(IMAGE, save_all=True, append_images=others, duration=durations, loop=0, optimize=True)
    print(f"{IMAGE}: {len(pictures)} pictures, {IMAGE.stat().st_size / 1e6:.2f} MB")


def growing(mapper: Mapper) -> Iterator[NDArray[np.uint8]]:
    """(H, W, 3) uint8 images after every keyframe, or every n-th one: the map, and beside it the depth image."""
    known = mapper.keyframes
    clouds = list(map(labelled, known.seen, known.poses))
    everything = np.concatenate([points for points, _ in clouds])[:, :2]
    low, high = everything.min(axis=0) - MARGIN, everything.max(axis=0) + MARGIN
    width, height = np.ceil((high - low) * PIXELS).astype(int)
    ground, top = np.full((height, width, 3), BACKGROUND, np.uint8), np.full((height, width), -np.inf)
    way: list[NDArray[np.int32]] = []
    for k, ((points, colours), T, seen) in enumerate(zip(clouds, known.poses, known.seen, strict=True)):
        for point, colour in zip(points[points[:, 2].argsort()], colours[points[:, 2].argsort()], strict=True):
            u, v = pixel(point, low, height)
            patch = top[v - 1 : v + 2, u - 1 : u + 2]
            higher = patch <= point[2]
            patch[higher] = point[2]
            ground[v - 1 : v + 2, u - 1 : u + 2][higher] = colour
        way.append(pixel(T[:2, 3], low, height))
        if k % (1 + len(clouds) // FRAMES) == 0 or k == len(clouds) - 1:
            yield beside(drawn(ground, way, T, low), depth_picture(seen.frame.depth))


def labelled(seen: Seen, T: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """(N, 3) points in ``map``, m, without the ceiling, and their colours (N, 3); none if it was not labelled."""
    if seen.shares is None:
        return np.zeros((0, 3)), np.zeros((0, 3), np.uint8)
    labels = seen.shares.classes[:, 0]
    kept = labels != Label.CEILING
    return seen.points_at(T)[kept], COLOURS[labels[kept]]


def pixel(point: NDArray[np.float64], low: NDArray[np.float64], height: int) -> NDArray[np.int32]:
    u, v = (point[:2] - low) * PIXELS
    return np.array([u, height - 1 - v], np.int32)


def drawn(
    ground: NDArray[np.uint8], way: list[NDArray[np.int32]], T: NDArray[np.float64], low: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """The map with the robot's trajectory and the robot on it."""
    picture = ground.copy()
    cv2.polylines(picture, [np.array(way)], False, WAY, 2, cv2.LINE_AA)
    half = np.array([robot_model().length, robot_model().width]) / 2
    corners = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1)]) * half @ T[:2, :2].T + T[:2, 3]
    cv2.fillConvexPoly(picture, np.array([pixel(c, low, len(picture)) for c in corners]), ROBOT, cv2.LINE_AA)
    ahead = pixel(T[:2, :2] @ [half[0], 0] + T[:2, 3], low, len(picture))
    cv2.circle(picture, ahead.tolist(), 5, (255, 255, 255), -1, cv2.LINE_AA)
    return picture


def beside(picture: NDArray[np.uint8], depth: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The map, with the depth image at its top right."""
    column = np.full((len(picture), depth.shape[1] + 10, 3), BACKGROUND, np.uint8)
    column[10 : 10 + len(depth), :-10] = depth
    return np.hstack([picture, column])


def depth_picture(depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(H, W, 3): near is light, 3.5 m dark, no return black."""
    small = cv2.resize(depth, DEPTH, interpolation=cv2.INTER_NEAREST)
    grey = np.where(small > 0, 255 - 200 * (small / 3.5).clip(0, 1), 0) // 16 * 16
    return np.repeat(grey[..., None], 3, axis=2).astype(np.uint8)


if __name__ == "__main__":
    main()
