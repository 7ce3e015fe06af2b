"""Draw the pictures of the lanes and the maze for arenas.md."""

import mujoco

from pipeline.arrays import Rgb
from sarsim.plugins.lanes.lanes import LANES, MAZE
from sarsim.plugins.lanes.plugin import lane_arena
from sarsim.sensors.rendering import Renderer
from scripts.pictures.layout import beside, captioned, on_background, save, stacked

PICTURES_PER_ROW = 3
"""Number of pictures in a row."""


def draw() -> None:
    """Draw all lanes on one sheet, and the maze on another."""
    pictures = [
        captioned(lane_picture(lane, (480, 320), 9.5 if lane == "avoid_holes" else 6.2, 110, -42), lane)
        for lane in LANES
    ]
    rows = [beside(*pictures[n : n + PICTURES_PER_ROW]) for n in range(0, len(pictures), PICTURES_PER_ROW)]
    save("lanes.jpg", stacked(*rows), 82)
    save("maze.jpg", lane_picture(MAZE, (1200, 760), 12.0, 90, -66), 82)


def lane_picture(lane: str, size: tuple[int, int], distance: float, azimuth: float, elevation: float) -> Rgb:
    """(H, W, 3) image of a lane without its roof, from ``distance`` m away from its centre; angles in degrees."""
    root = lane_arena(lane).mjcf_model
    for roof in [g for g in root.find_all("geom") if g.dclass is not None and g.dclass.dclass == "ceiling"]:
        roof.remove()
    model = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    data, view = mujoco.MjData(model), mujoco.MjvCamera()
    mujoco.mj_forward(model, data)
    view.lookat[:], view.distance, view.azimuth, view.elevation = (0, 0, 0), distance, azimuth, elevation
    with Renderer(model, *size) as renderer:
        return on_background(renderer.colour(data, view))
