"""Draw the pictures of the lanes in arenas.md: ``python docs/figures/draw_lanes.py``."""

from pathlib import Path

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from sarsim.plugins.lanes.lanes import LANES, MAZE
from sarsim.plugins.lanes.plugin import lane_arena
from sarsim.sensors.rendering import Renderer

IMAGES = Path(__file__).parents[1] / "images"
ACROSS = 3  # pictures in a row


def main() -> None:
    pictures = [
        labelled(drawn(lane, (480, 320), 9.5 if lane == "avoid_holes" else 6.2, 110, -42), lane) for lane in LANES
    ]
    rows = [np.hstack(pictures[n : n + ACROSS]) for n in range(0, len(pictures), ACROSS)]
    save("lanes.jpg", np.vstack(rows))
    save("maze.jpg", drawn(MAZE, (1200, 760), 12.0, 90, -66))


def drawn(lane: str, size: tuple[int, int], distance: float, azimuth: float, elevation: float) -> NDArray[np.uint8]:
    """(H, W, 3) image of a lane without its roof, from ``distance`` m away from its centre; angles in degrees."""
    root = lane_arena(lane).mjcf_model
    for roof in [g for g in root.find_all("geom") if g.dclass is not None and g.dclass.dclass == "ceiling"]:
        roof.remove()
    model = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    data, view = mujoco.MjData(model), mujoco.MjvCamera()
    mujoco.mj_forward(model, data)
    view.lookat[:], view.distance, view.azimuth, view.elevation = (0, 0, 0), distance, azimuth, elevation
    with Renderer(model, *size) as renderer:
        return renderer.colour(data, view)


def labelled(picture: NDArray[np.uint8], name: str) -> NDArray[np.uint8]:
    """(H, W, 3) image with a name in its corner."""
    cv2.putText(
        picture := picture.copy(), name, (10, 26), cv2.FONT_HERSHEY_SIMPLEX, 0.7, (255, 255, 255), 2, cv2.LINE_AA
    )
    return picture


def save(name: str, picture: NDArray[np.uint8]) -> None:
    cv2.imwrite(str(IMAGES / name), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 82])


if __name__ == "__main__":
    main()
