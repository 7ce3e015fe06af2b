"""A labelled RGB-D frame against the three passes of ``mujoco.Renderer``.

Every contender draws in a process of its own, because two OpenGL contexts in one process get in each other's way. The
processes take turns frame by frame, so one draws while the others wait, and whatever else the machine does falls on
all alike.
"""

import multiprocessing
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection

import mujoco
import numpy as np
from rich.progress import track

from pipeline.errors import InputError
from sarsim.assets import asset
from sarsim.scripts.benchmarks.subject import Result, Subject
from sarsim.sensors.camera import RgbdCamera
from sarsim.sensors.rendering import COLOUR_QUALITY, Renderer
from sarsim.sensors.xtion import Xtion

POSES = [
    (-2.4, -1.35, 0.0),
    (-1.2, -1.4, 0.2),
    (2.3, -1.2, 2.4),
    (0.0, -0.1, 0.0),
    (2.2, 1.2, 3.0),
    (-1.5, 1.3, -0.2),
]
"""x, y in m and yaw in rad in ``nist_6x4``: at the start, before a ramp, at a victim, on both decks, in a lane."""
HEIGHT = 0.75  # m; above the decks as high as the robot's mast
WARM_UP = 2  # rounds that are not counted


@dataclass(frozen=True)
class Camera(Subject):
    """A labelled RGB-D frame against mujoco.Renderer's colour, depth and segmentation."""

    frames: int = 60
    """How many frames each contender draws."""
    width: int = 640
    """pixels."""
    height: int = 480
    """pixels."""

    def measure(self) -> Result:
        """Medians over all frames, and how many times faster than mujoco.Renderer a frame is.

        Raises:
            InputError: there is nothing to draw.
        """
        if min(self.frames, self.width, self.height) < 1:
            raise InputError("--frames, --width and --height: give at least 1")
        times: dict[str, list[Times]] = {name: [] for name in CONTENDERS}
        workers = {name: _start(name, self.width, self.height) for name in CONTENDERS}
        for i in track(range(WARM_UP + self.frames), "camera", transient=True):
            for name, connection in workers.items():
                connection.send(POSES[i % len(POSES)])
                times[name].append(connection.recv())
        for connection in workers.values():
            connection.send(None)
        return Result(_figures({name: rows[WARM_UP:] for name, rows in times.items()}))


@dataclass
class Times:
    """Milliseconds of one frame, and of its parts each by itself."""

    frame: float
    parts: dict[str, float]


def _figures(times: dict[str, list[Times]]) -> dict[str, float]:
    """Medians: of the ratio between two frames of a round, and of frames and parts in milliseconds."""
    frame = {name: np.array([row.frame for row in rows]) for name, rows in times.items()}
    figures = {
        f"frame_vs_{name}": float(np.median(frame[name] / frame["ours"]))
        for name in CONTENDERS
        if name != "ours"
    }
    for name, rows in times.items():
        figures[f"{name}.frame_ms"] = float(np.median(frame[name]))
        for part in rows[0].parts:
            figures[f"{name}.{part}_ms"] = float(np.median([row.parts[part] for row in rows]))
    return figures


def _start(name: str, width: int, height: int) -> Connection:
    """Start a contender's process: send it a pose, receive the times of its frame; None ends it."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    # The new process inherits that Ctrl-C is ignored: it ends with this one, which reports it.
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    context.Process(target=_serve, args=(name, theirs, width, height), daemon=True).start()
    signal.signal(signal.SIGINT, handler)
    theirs.close()
    return ours


def _serve(name: str, connection: Connection, width: int, height: int) -> None:
    """What a contender's process does."""
    model = _model(width, height)
    data = mujoco.MjData(model)
    frame = CONTENDERS[name](model, data, width, height)
    while (pose := connection.recv()) is not None:
        x, y, yaw = pose
        data.mocap_pos[0] = x, y, HEIGHT
        data.mocap_quat[0] = np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)
        mujoco.mj_forward(model, data)
        connection.send(frame())


def _model(width: int, height: int) -> mujoco.MjModel:
    """The arena, with a camera of the Xtion's field of view on a body that can be put anywhere, 15° nose down."""
    spec = mujoco.MjSpec.from_file(str(asset("arenas", "nist_6x4.xml")))
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    rig = spec.worldbody.add_body(name="rig", mocap=True)
    camera = rig.add_camera(name="camera", fovy=45)
    camera.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
    camera.alt.xyaxes = [0, -1, 0, np.sin(np.radians(15)), 0, np.cos(np.radians(15))]
    return spec.compile()


def _milliseconds(action: Callable[[], object]) -> float:
    start = time.perf_counter()
    action()
    return 1e3 * (time.perf_counter() - start)


def _ours(model: mujoco.MjModel, data: mujoco.MjData, width: int, height: int) -> Callable[[], Times]:
    """Colour, depth, label and instance of every pixel, by the ideal sensor."""
    renderer = Renderer(model, width, height)
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
        whole = _milliseconds(lambda: Xtion.ideal().apply(camera.capture(data), rng))
        return Times(whole, {name: _milliseconds(part) for name, part in parts.items()})

    return frame


def _renderer(
    model: mujoco.MjModel, data: mujoco.MjData, width: int, height: int, **quality: int
) -> Callable[[], Times]:
    """``mujoco.Renderer`` at MuJoCo's default quality, but for ``quality``: colour, depth and ids in three passes."""
    default = mujoco.MjSpec().visual.quality
    for name in ("offsamples", "shadowsize", "numslices", "numstacks", "numquads"):
        setattr(model.vis.quality, name, quality.get(name, getattr(default, name)))
    renderer = mujoco.Renderer(model, height, width)

    def draw() -> None:
        renderer.update_scene(data, "camera")
        renderer.render()

    def frame() -> Times:
        parts = {"colour": _milliseconds(draw)}
        renderer.enable_depth_rendering()
        parts["depth"] = _milliseconds(draw)
        renderer.enable_segmentation_rendering()
        parts["segmentation"] = _milliseconds(draw)
        renderer.disable_segmentation_rendering()
        return Times(sum(parts.values()), parts)

    return frame


CONTENDERS: dict[str, Callable[..., Callable[[], Times]]] = {
    "ours": _ours,
    "renderer": _renderer,
    "renderer_without_multisampling": partial(_renderer, offsamples=0),
    "renderer_at_our_quality": partial(_renderer, **COLOUR_QUALITY),
}
