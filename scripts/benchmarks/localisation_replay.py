"""Replays a recorded drive with every method: trajectories as TUM files, scores, times, and a picture."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from time import process_time
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Rgb
from pipeline.localisation.trajectory import write_tum
from sarsim.ground_truth.true_surface import GroundTruthSurface
from scripts.benchmarks.episodes import Job, leave
from scripts.benchmarks.localisation_drives import DriveReader, drive_file
from scripts.benchmarks.localisation_methods import METHODS, Method, is_blind
from scripts.benchmarks.localisation_scores import evo_ate, trajectory_scores, way_driven
from scripts.benchmarks.top_view import BAND, caption, ground_picture, pixels

AGREEMENT = 1e-6  # m, tolerated difference between our ATE and evo's, which is computed from rounded files
COLOURS = {
    "odometry": (150, 150, 150),
    "open3d": (230, 140, 0),
    "kiss_icp": (150, 60, 200),
    "ours_without_loops": (60, 170, 230),
    "ours": (0, 130, 60),
    "true": (0, 0, 0),
}
"""RGB colours of the methods; later ones are drawn over earlier ones."""


def replay_job(job: Job, folder: Path, drives: Path, names: Sequence[str]) -> None:
    """Replay a drive, and write scores as JSON, trajectories as TUM files, and a picture to a folder."""

    def made() -> dict[str, Any]:
        with DriveReader(drive_file(job, drives)) as drive:
            methods = {name: METHODS[name](drive.T_world_base[0]) for name in names}
            return {"report": replay(drive, methods, folder / job.name)}

    leave(job, folder, made)


def replay(drive: DriveReader, methods: Mapping[str, Method], stem: Path) -> dict[str, Any]:
    """Scores of every method by name; writes ``<stem>-<name>.tum``, ``<stem>-true.tum`` and ``<stem>.png``.

    Raises:
        ArithmeticError: our ATE differs from evo's.
    """
    online, seconds = follow(drive, methods)
    believed = {name: method.corrected(online[name]) for name, method in methods.items()}
    report: dict[str, Any] = {"frames": len(drive), "way_m": float(way_driven(drive.T_world_base)[-1])}
    files = {name: stem.with_name(f"{stem.name}-{name}.tum") for name in (*methods, "true")}
    for name, poses in {"true": drive.T_world_base, **believed}.items():
        write_tum(files[name], drive.time.tolist(), list(poses))
    for name, method in methods.items():
        scores = trajectory_scores(drive.T_world_base, believed[name])
        if not abs(scores["ate_m"] - evo_ate(files["true"], files[name])) <= AGREEMENT:
            raise ArithmeticError(f"{name}: ATE {scores['ate_m']} m differs from evo's")
        rest = {"frame_ms": 1e3 * float(np.median(seconds[name]))} | method.report(drive.T_world_base, online[name])
        report[name] = scores | rest
    ways = {"true": drive.T_world_base[:, :3, 3]} | {name: poses[:, :3, 3] for name, poses in believed.items()}
    text = ", ".join(f"{name.replace('_', ' ')} {report[name]['ate_m']:.3f} m" for name in methods)
    picture = picture_of(drive.surface, ways, f"{drive.settings['config']['arena']}: {text}")
    cv2.imwrite(str(stem.with_name(f"{stem.name}.png")), picture[..., ::-1])
    return report


def follow(
    drive: DriveReader, methods: Mapping[str, Method]
) -> tuple[dict[str, NDArray[np.float64]], dict[str, NDArray[np.float64]]]:
    """By method, (N, 4, 4) online estimates, and processor time of each frame with enough returns, s."""
    poses: dict[str, list[NDArray[np.float64]]] = {name: [] for name in methods}
    seconds: dict[str, list[float]] = {name: [] for name in methods}
    for frame in drive:
        for name, method in methods.items():
            start = process_time()
            poses[name].append(method.localise(frame))
            if not is_blind(frame):
                seconds[name].append(process_time() - start)
    return {n: np.array(p) for n, p in poses.items()}, {n: np.array(s) for n, s in seconds.items()}


def picture_of(surface: GroundTruthSurface, ways: Mapping[str, NDArray[np.float64]], text: str) -> Rgb:
    """Top view of the trajectories, with x to the right and y up.

    Args:
        surface: the true ground.
        ways: trajectories by name, as in ``COLOURS``, each (N, 2 or 3) in the world, m.
        text: the last line, below the colour legend.
    """
    picture, scale = ground_picture(surface, surface.drivable)
    for name, colour in COLOURS.items():
        if name in ways:
            way = pixels(surface.grid, scale, ways[name][:, :2])
            cv2.polylines(picture, [way], False, colour, 1 + (name != "true"), cv2.LINE_AA)
    width, names = picture.shape[1], [name for name in reversed(COLOURS) if name in ways]
    return np.vstack([picture, _legend(names, width), caption(text, width)])


def _legend(names: list[str], width: int) -> NDArray[np.uint8]:
    """(BAND, width, 3) uint8 RGB picture of the names in their colours."""
    band = np.full((BAND, width, 3), 255, np.uint8)
    font, size, x = cv2.FONT_HERSHEY_SIMPLEX, 0.45, 6
    for name in names:
        text = name.replace("_", " ")
        cv2.putText(band, text, (x, BAND - 9), font, size, COLOURS[name], 1, cv2.LINE_AA)
        x += cv2.getTextSize(text, font, size, 1)[0][0] + 20
    return band
