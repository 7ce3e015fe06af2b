"""Draw docs/images/episode.webp: an episode from above, with the robot's labels, and as the robot's camera sees it.

The run must be an episode in the arena nist_6x4.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation, Slerp

from pipeline.files import read_numbers
from pipeline.keyframes import KeyframeObservation
from pipeline.labels import COLOURS, PLAIN_NAMES, Label
from pipeline.lettering import write
from pipeline.map_file import read_keyframes
from pipeline.transforms import from_rotation
from sarsim.arenas.load import load_arena
from sarsim.scoring.coverage import Coverage
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from scripts.pictures.layout import BACKGROUND, DIM_INK, IMAGES, INK, blank

IMAGE_INTERVAL, DISPLAY_TIME, LAST_DISPLAY_TIME = 1.5, 130, 3500
"""Time of the episode between two images, s; display times of each image and of the last image, ms."""
OVERVIEW_SIZE, OVERVIEW_ROWS = (720, 540), (45, 467)
"""Size of the picture from above, and the range of its rows that is shown, pixels."""
SIDE_WIDTH = 300
"""Width of the column to the right of the picture from above, pixels."""
MAX_SKY_VALUE = 16
"""Maximum value of the sky's colours in the robot's noisy image."""
SKY_DISTANCE = 20.0
"""Distance from the overview camera beyond which there is no part of the arena, m."""
MAX_DEPTH_BEHIND = 0.03
"""Maximum distance of a painted point behind the surface in the picture, m."""
LABEL_OPACITY = 0.8
"""Opacity of a label's colour."""
PERSON_MARGIN = 0.1
"""Margin around the box of a person who was found, m; clutter inside is drawn as part of the person."""
LEGEND_LABELS = Label.WALL, Label.TERRAIN, Label.INCLINED_RAMP, Label.STRAIGHT_RAMP, Label.VICTIM
TRACK = (255, 255, 255)
QUALITY = 50
IMAGE = IMAGES / "episode.webp"


@dataclass(frozen=True, eq=False)
class Drive:
    """The drive of an episode.

    Attributes:
        times: (N,) times of the true poses, s.
        places: (N, 3) true positions, m.
        rotations: the true rotations, interpolated over time.
        keyframes: time of each keyframe, s, and the observation stored for it.
        poses: (K, 4, 4) poses of the keyframes.
        people: time at which each person was found, s, and the person's position (3,) and size (3,), m.
    """

    times: NDArray[np.float64]
    places: NDArray[np.float64]
    rotations: Slerp
    keyframes: list[tuple[float, KeyframeObservation]]
    poses: NDArray[np.float64]
    people: list[tuple[float, NDArray[np.float64], NDArray[np.float64]]]


def draw(folder: Path) -> None:
    """Draw the episode in a folder."""
    robot = SimulatedRobot(load_arena("nist_6x4"), SimulationConfig(), seed=0)
    first, *others = list(render_images(read_drive(folder, robot), robot))
    durations = [DISPLAY_TIME] * len(others) + [LAST_DISPLAY_TIME]
    first.save(IMAGE, save_all=True, append_images=others, duration=durations, loop=0, quality=QUALITY, method=6)
    print(f"{IMAGE}: {1 + len(others)} pictures, {IMAGE.stat().st_size / 1e3:.0f} kB")
    robot.close()


def read_drive(folder: Path, robot: SimulatedRobot) -> Drive:
    """Read the drive of an episode from its folder."""
    columns = "t x y z qx qy qz qw"
    true = read_numbers(folder / "trajectory_true.tum", columns)
    keyframes = read_keyframes(folder / "keyframes.npz", robot.model)
    people = [
        (person["times"][min(1, len(person["times"]) - 1)], np.array(person["position"]), np.array(person["size"]))
        for person in json.loads((folder / "victims.json").read_text())["people"]
        if person["confirmed"]
    ]
    times = true[passing_indices(true[:, 1:], np.array(keyframes.poses)), 0].tolist()
    seen = list(zip(times, keyframes.observations, strict=True))
    rotations = Slerp(true[:, 0], Rotation.from_quat(true[:, 4:]))
    return Drive(true[:, 0], true[:, 1:4], rotations, seen, keyframes.poses, people)


def passing_indices(track: NDArray[np.float64], poses: NDArray[np.float64]) -> NDArray[np.int64]:
    """(K,) indices in a track (N, 7), positions and quaternions, at which the robot passed ``poses`` (K, 4, 4).

    Dynamic programming finds the indices, in the order of the drive, with the minimum sum of distances.
    """
    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    apart = np.linalg.norm(track[:, :3] - poses[:, None, :3, 3], axis=2)
    apart += 1 - np.abs(quaternions @ track[:, 3:].T)
    total, back = apart[0], []
    for row in apart[1:]:
        best = np.minimum.accumulate(total)
        back.append(np.maximum.accumulate(np.where(total == best, np.arange(len(total)), 0)))
        total = row + best
    chosen = [int(total.argmin())]
    for before in reversed(back):
        chosen.append(int(before[chosen[-1]]))
    return np.array(chosen[::-1])


def render_images(drive: Drive, robot: SimulatedRobot) -> Iterator[Image.Image]:
    """Yield one image per ``IMAGE_INTERVAL`` of the drive."""
    coverage, done = Coverage(robot), 0
    clouds = [(np.zeros((0, 3), np.float32), np.zeros(0, np.int64))]
    for time in np.arange(drive.times[0], drive.times[-1] + IMAGE_INTERVAL, IMAGE_INTERVAL).clip(max=drive.times[-1]):
        while done < len(drive.keyframes) and drive.keyframes[done][0] <= time:
            clouds.append(labelled_points(drive.keyframes[done][1], drive.poses[done]))
            coverage.see(drive.keyframes[done][1].points_at(drive.poses[done]))
            done += 1
        place = np.array([np.interp(time, drive.times, along) for along in drive.places.T])
        T = from_rotation(drive.rotations(time).as_matrix(), place)
        robot.robot.set_pose(robot.physics, T[:3, 3], np.roll(Rotation.from_matrix(T[:3, :3]).as_quat(), 1))
        robot.physics.forward()
        points, labels = (np.concatenate(parts) for parts in zip(*clouds, strict=True))
        for found, middle, size in drive.people:
            is_person = (np.abs(points - middle) <= size / 2 + PERSON_MARGIN).all(axis=1) & (labels == Label.CLUTTER)
            labels = np.where(is_person & (found <= time), Label.VICTIM, labels)
        track = drive.places[drive.times <= time]
        picture = painted_overview(robot, points, COLOURS[labels], track)
        yield composed_image(picture, robot.sense().rgb, time - drive.times[0], coverage.fraction)


def labelled_points(
    seen: KeyframeObservation, T: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """(N, 3) points of a keyframe in ``map``, m, except the ceiling, and their labels (N,); empty without labels."""
    if seen.top_two_classes is None:
        return np.zeros((0, 3), np.float32), np.zeros(0, np.int64)
    labels = seen.top_two_classes.classes[:, 0].astype(np.int64)
    kept = labels != Label.CEILING
    return seen.points_at(T)[kept], labels[kept]


def painted_overview(
    robot: SimulatedRobot, points: NDArray[np.float32], colours: NDArray[np.uint8], track: NDArray[np.float64]
) -> NDArray[np.uint8]:
    """(H, W, 3) image of the arena from above, with the visible points and the robot's track (N, 3) m painted on."""
    data = robot.physics.data.ptr
    picture = np.asarray(cv2.resize(robot.renderer.colour(data, "overview"), OVERVIEW_SIZE), np.uint8)
    depth = cv2.resize(robot.renderer.segmentation_and_depth(data, "overview")[1], OVERVIEW_SIZE)
    uv, far = project(robot, points)
    layer = np.zeros_like(picture)
    for step in ((0, 0), (1, 0), (0, 1), (1, 1), (-1, 0), (0, -1)):
        u, v = (uv.astype(int) + step).clip(0, np.array(OVERVIEW_SIZE) - 1).T
        in_sight = far < depth[v, u] + MAX_DEPTH_BEHIND
        layer[v[in_sight], u[in_sight]] = colours[in_sight]
    opacity = LABEL_OPACITY * layer.any(axis=2, keepdims=True)
    picture = np.ascontiguousarray((picture * (1 - opacity) + layer * opacity).astype(np.uint8))
    picture[(depth <= 0) | (depth >= SKY_DISTANCE)] = BACKGROUND
    line, far = project(robot, track + np.array([0, 0, MAX_DEPTH_BEHIND]))
    u, v = line.astype(int).clip(0, np.array(OVERVIEW_SIZE) - 1).T
    in_sight = far < depth[v, u] + MAX_DEPTH_BEHIND
    for n in np.flatnonzero(in_sight[1:] & in_sight[:-1]):
        start, end = line[n : n + 2].round().astype(int).tolist()
        cv2.line(picture, start, end, TRACK, 2, cv2.LINE_AA)
    return picture


def project(robot: SimulatedRobot, points: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, 2) pixels of points (N, 3) m in the picture from above, and their depths (N,) m."""
    view = robot.physics.named
    in_camera = (points - view.data.cam_xpos["overview"]) @ view.data.cam_xmat["overview"].reshape(3, 3)
    focal = OVERVIEW_SIZE[1] / 2 / np.tan(np.radians(view.model.cam_fovy["overview"]) / 2)
    return in_camera[:, :2] * (1, -1) / -in_camera[:, 2:] * focal + np.array(OVERVIEW_SIZE) / 2, -in_camera[:, 2]


def composed_image(picture: NDArray[np.uint8], view: NDArray[np.uint8], time: float, explored: float) -> Image.Image:
    """The picture from above and, to its right, the robot's view, the clock, the explored fraction and a legend."""
    image = blank(OVERVIEW_SIZE[0] + SIDE_WIDTH, OVERVIEW_ROWS[1] - OVERVIEW_ROWS[0])
    image[:, : OVERVIEW_SIZE[0]] = picture[slice(*OVERVIEW_ROWS)]
    tall = SIDE_WIDTH * view.shape[0] // view.shape[1]
    view = np.where(view.max(axis=2, keepdims=True) > MAX_SKY_VALUE, view, np.array(BACKGROUND, np.uint8))
    image[:tall, OVERVIEW_SIZE[0] :] = cv2.resize(view, (SIDE_WIDTH, tall), interpolation=cv2.INTER_AREA)
    left, line = OVERVIEW_SIZE[0] + 16, tall + 37
    minutes, seconds = divmod(int(time), 60)
    write(image, (left, line), f"{minutes}:{seconds:02d}", 30, INK)
    write(image, (left + 100, line), f"{explored:.0%}", 30, INK)
    write(image, (left + 185, line), "explored", 18, DIM_INK)
    for n, label in enumerate(LEGEND_LABELS):
        y = tall + 56 + 27 * n
        image[y : y + 20, left : left + 20] = COLOURS[label]
        write(image, (left + 32, y + 16), PLAIN_NAMES[label], 18, INK)
    return Image.fromarray(image)
