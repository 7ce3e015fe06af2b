"""Time per labelled RGB-D frame, compared with three passes of ``mujoco.Renderer``.

Every contender renders in its own process, because two OpenGL contexts in one process interfere with each other.
The processes take turns frame by frame, so that other load on the machine slows all contenders alike.
"""

from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import ClassVar

import mujoco
import numpy as np

from sarsim.assets import asset
from sarsim.commands.cli import tracked
from sarsim.jobs import start_worker
from sarsim.sensors.camera import RgbdCamera
from sarsim.sensors.rendering import Renderer
from sarsim.sensors.xtion import Xtion
from scripts.benchmarks.common import RENDERERS, Result, ThreePasses, check_at_least, wall_time_of
from scripts.benchmarks.settings import CameraSettings

POSES = [
    (-2.4, -1.35, 0.0), (-1.2, -1.4, 0.2), (2.3, -1.2, 2.4), (0.0, -0.1, 0.0), (2.2, 1.2, 3.0), (-1.5, 1.3, -0.2),
]  # fmt: skip
"""x, y in m and yaw in rad in ``nist_6x4``: at the start, before a ramp, at a victim, on both decks, in a lane."""
CAMERA_HEIGHT = 0.75  # m, height of the robot's mast above the decks
IMAGE_SIZE = 640, 480  # Width and height of the images, pixels
UNCOUNTED_ROUNDS = 2  # Warm-up rounds, not timed


class WithoutMultisampling(ThreePasses):
    """``mujoco.Renderer`` with one sample per pixel."""

    QUALITY: ClassVar[dict[str, int]] = {"offsamples": 0}


CONTENDERS: dict[str, type[Renderer]] = {**RENDERERS, "renderer_without_multisampling": WithoutMultisampling}
Times = dict[str, float]  # ms of a complete "frame", and of each of its parts alone


def measure(settings: CameraSettings) -> Result:
    """Median times of a frame and its parts, and the speed-up of our renderer over every other contender.

    Raises:
        InputError: a number is below 1.
    """
    check_at_least(1, settings, "frames")
    times: dict[str, list[Times]] = {name: [] for name in CONTENDERS}
    workers = {name: start_worker(_serve, name, *IMAGE_SIZE, environment={}) for name in CONTENDERS}
    for i in tracked(range(UNCOUNTED_ROUNDS + settings.frames), "camera"):
        for name, (_, connection) in workers.items():
            connection.send(POSES[i % len(POSES)])
            times[name].append(connection.recv())
    for process, connection in workers.values():
        connection.send(None)
        process.join()
    return Result(summary({name: rows[UNCOUNTED_ROUNDS:] for name, rows in times.items()}))


def summary(times: dict[str, list[Times]]) -> dict[str, float]:
    """Median ratios of frame times within a round, and median times of frames and parts, ms."""
    frame = {name: np.array([row["frame"] for row in rows]) for name, rows in times.items()}
    figures = {
        f"frame_vs_{name}": float(np.median(frame[name] / frame["ours"])) for name in CONTENDERS if name != "ours"
    }
    for name, rows in times.items():
        figures |= {f"{name}.{part}_ms": float(np.median([row[part] for row in rows])) for part in rows[0]}
    return figures


def _serve(connection: Connection, name: str, width: int, height: int) -> None:
    """The loop of a contender's process: receive a pose and send the times of its frame; None ends the loop."""
    model = _model(width, height)
    data = mujoco.MjData(model)
    with CONTENDERS[name](model, width, height) as renderer:
        frame = _theirs(renderer, data) if isinstance(renderer, ThreePasses) else _ours(renderer, data)
        while (pose := connection.recv()) is not None:
            x, y, yaw = pose
            data.mocap_pos[0] = x, y, CAMERA_HEIGHT
            data.mocap_quat[0] = np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)
            mujoco.mj_forward(model, data)
            connection.send(frame())


def _model(width: int, height: int) -> mujoco.MjModel:
    """The arena, with a camera on a mocap body: the Xtion's field of view, pitched down by 15°."""
    spec = mujoco.MjSpec.from_file(str(asset("arenas", "nist_6x4.xml")))
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    rig = spec.worldbody.add_body(name="rig", mocap=True)
    camera = rig.add_camera(name="camera", fovy=45)
    camera.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
    camera.alt.xyaxes = [0, -1, 0, np.sin(np.radians(15)), 0, np.cos(np.radians(15))]
    return spec.compile()


def _ours(renderer: Renderer, data: mujoco.MjData) -> Callable[[], Times]:
    """A function that times our frame, with colour, depth, label and instance per pixel, and its parts."""
    camera = RgbdCamera(renderer, "camera")
    rng = np.random.default_rng(0)
    image = camera.capture(data)
    parts: dict[str, Callable[[], object]] = {
        "colour": lambda: renderer.colour(data, "camera"),
        "segmentation_and_depth": lambda: renderer.segmentation_and_depth(data, "camera"),
        "ideal": lambda: Xtion.ideal().apply(image, rng),
        "xtion": lambda: Xtion().apply(image, rng),
    }

    def frame() -> Times:
        whole = 1e3 * wall_time_of(lambda: Xtion.ideal().apply(camera.capture(data), rng))
        return {"frame": whole} | {name: 1e3 * wall_time_of(part) for name, part in parts.items()}

    return frame


def _theirs(renderer: ThreePasses, data: mujoco.MjData) -> Callable[[], Times]:
    """A function that times colour, depth and ids in three passes."""
    passes = {"colour": renderer.colour, "depth": renderer.depth, "segmentation": renderer.segmentation}

    def frame() -> Times:
        parts = {name: 1e3 * wall_time_of(draw, data, "camera") for name, draw in passes.items()}
        return {"frame": sum(parts.values())} | parts

    return frame
