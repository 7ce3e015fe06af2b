"""Draw the pictures of victims.md: ``python docs/figures/draw_victims.py``."""

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, fromstring, tostring

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from sarsim.sensors.rendering import Renderer
from sarsim.victims.victims import Placement, Posture, VictimModel, make_victim

IMAGES = Path(__file__).parents[1] / "images"
EYE = 0.62
"""Height of the robot's camera, m."""
STAGE = """
<mujoco>
  <size nuser_geom="1"/>
  <statistic extent="6" center="0 0 0.3"/>
  <visual>
    <headlight ambient="0.25 0.25 0.25" diffuse="0.25 0.25 0.25" specular="0 0 0"/>
    <map znear="0.005" zfar="10"/>
  </visual>
  <asset>
    <texture name="floor" type="2d" builtin="flat" rgb1="0.60 0.58 0.54" mark="random" markrgb="0.52 0.50 0.47"
      random="0.05" width="512" height="512"/>
    <material name="floor" texture="floor" texuniform="true" specular="0.05"/>
    <material name="panel" rgba="0.78 0.64 0.45 1" specular="0.05"/>
  </asset>
  <worldbody>
    <light pos="1.5 -0.5 3.5" dir="-0.1 0.1 -1" diffuse="0.45 0.45 0.43" cutoff="80" exponent="1"/>
    <light pos="-1.5 0.5 3.5" dir="0.1 -0.1 -1" diffuse="0.45 0.45 0.43" cutoff="80" exponent="1" castshadow="false"/>
    <geom type="plane" size="5 5 0.1" material="floor"/>
  </worldbody>
</mujoco>
"""
SHEET: list[tuple[Posture, Placement, float]] = [
    ("lying", "open", 125), ("lying", "open", 55), ("lying", "open", 235), ("prone", "open", 60),
    ("prone", "open", 125), ("prone", "open", 240), ("side", "open", 110), ("side", "open", 250),
    ("side", "open", 60), ("sitting", "open", 205), ("sitting", "open", 180), ("sitting", "open", 155),
    ("slumped", "open", 205), ("slumped", "open", 180), ("slumped", "open", 150), ("seated", "open", 200),
    ("seated", "open", 165), ("lying", "rubble", 130), ("prone", "rubble", 50), ("side", "rubble", 250),
    ("sitting", "box", 195), ("bust", "box", 190), ("side", "hole", 180), ("sitting", "hole", 185),
]  # fmt: skip
"""Posture, placement, and the camera's azimuth, degrees."""
DISTANCE = {"box": 1.7, "hole": 2.7}
"""Distance of the camera for some placements, m."""


def main() -> None:
    rng = np.random.default_rng(4)
    sheet = [
        picture(make_victim(str(n), rng, posture, placement), azimuth, DISTANCE.get(placement, 2.1), (320, 240))
        for n, (posture, placement, azimuth) in enumerate(SHEET)
    ]
    save("victims.jpg", tiled(sheet, 6))
    people = [make_victim(str(n), rng, posture) for n, posture in enumerate(("sitting", "lying", "prone"))]
    views = [
        picture(person, azimuth, distance, (480, 360))
        for person, azimuth in zip(people, (195, 120, 60), strict=True)
        for distance in (1.2, 2.0, 3.0)
    ]
    save("victims-distance.jpg", tiled(views, 3))


def picture(victim: VictimModel, azimuth: float, distance: float, size: tuple[int, int]) -> NDArray[np.uint8]:
    """(H, W, 3) RGB image of a victim, from the height and with the field of view of the robot's camera."""
    model = stage(victim)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    view = mujoco.MjvCamera()
    view.lookat[:] = [*victim.footprint.mean(axis=0), min(victim.height, 0.9) / 2]
    view.azimuth, view.distance = azimuth, distance
    view.elevation = -np.degrees(np.arcsin((EYE - view.lookat[2]) / distance))
    with Renderer(model, *size) as renderer:
        return renderer.colour(data, view)


def stage(victim: VictimModel) -> mujoco.MjModel:
    """A model of the victim on a floor, with a wall if the victim needs one."""
    root: Element = fromstring(STAGE)
    if victim.needs_wall:
        wall = {"type": "box", "size": "0.02 2.5 0.6", "pos": "-0.02 0 0.6", "material": "panel"}
        SubElement(root.find("worldbody"), "geom", wall)
    victim.add_to(root, (0, 0, 0), 0)
    return mujoco.MjModel.from_xml_string(tostring(root, encoding="unicode"))


def tiled(pictures: list[NDArray[np.uint8]], columns: int) -> NDArray[np.uint8]:
    rows = [np.hstack(pictures[n : n + columns]) for n in range(0, len(pictures), columns)]
    return np.vstack(rows)


def save(name: str, rgb: NDArray[np.uint8]) -> None:
    cv2.imwrite(str(IMAGES / name), rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main()
