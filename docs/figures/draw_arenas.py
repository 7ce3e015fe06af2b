"""Draw the pictures of arenas.md, networks.md and tutorial-arena.md: ``python docs/figures/draw_arenas.py``."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from sarsim.arenas.load import load_arena
from sarsim.arenas.random_arena import RandomArenaConfig
from sarsim.assets import asset
from sarsim.environment import RescueEnvironment
from sarsim.plugins.fiducials.tags import hang_fiducials
from sarsim.sensors.rendering import Renderer
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig

DOCS = Path(__file__).parents[1]
IMAGES = DOCS / "images"
SIZE = (800, 600)


def main() -> None:
    draw_library()
    save("arena-nist.jpg", [overview("nist_6x4"), eye("nist_6x4", None)])
    save("arena-raf.jpg", [overview(str(DOCS / "example.raf")), eye(str(DOCS / "example.raf"), (6.0, 1.1, 100.0))])
    first = str(DOCS / "first.raf")
    save("arena-first.jpg", [overview(first), eye(first, None)])
    flat, decks, clutter, fields = (overview(f"random:{seed}") for seed in (8, 1, 6, 7))
    save("arenas-random.jpg", [flat, decks], [clutter, fields])
    large = RandomArenaConfig(columns=12, rows=9, victims=6, difficulty=3)
    roofed = RandomArenaConfig(ceiling=True, difficulty=1)
    save("arenas-more.jpg", [overview("random:11", large), eye("random:3", None, roofed)])
    furnished = RandomArenaConfig(columns=9, rows=7, furniture=0.25)
    rooms = RandomArenaConfig(wall_density=0.2, ramps=0.15, clutter=0.05, victims=2, furnished=0.35)
    save("furnished-rooms.jpg", [overview(f"random:{seed}", rooms) for seed in (4, 7)])
    tags = [eye("nist_6x4", start, fiducials=8) for start in ((-2.5, -1.3, -30.0), (1.6, -1.3, 10.0))]
    save("arena-fiducial.jpg", tags)
    save("arenas-furniture.jpg", [overview("random:16", furnished), eye("random:5", None, furnished)])


def draw_library() -> None:
    """Draw all elements of the library."""
    model = mujoco.MjModel.from_xml_path(str(asset("arenas", "elements.xml")))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    view = mujoco.MjvCamera()
    view.lookat[:], view.distance, view.azimuth, view.elevation = (7, 6.2, 0), 21, 90, -52
    with Renderer(model, 1600, 1000) as renderer:
        save("arena-elements.jpg", [renderer.colour(data, view)])


def overview(name: str, random: RandomArenaConfig | None = None) -> NDArray[np.uint8]:
    """(H, W, 3) image of the whole arena, with the robot at its start."""
    environment = RescueEnvironment(load_arena(name, random=random))
    model = environment.physics.model.ptr
    with Renderer(model, *SIZE) as renderer:
        picture = renderer.colour(environment.physics.data.ptr, "overview")
    environment.close()
    return picture


def eye(
    name: str, start: tuple[float, float, float] | None, random: RandomArenaConfig | None = None, fiducials: int = 0
) -> NDArray[np.uint8]:
    """(H, W, 3) image of the robot's camera at a start pose."""
    arena = load_arena(name, start, random)
    hang_fiducials(arena, fiducials, seed=0)
    robot = SimulatedRobot(arena, SimulationConfig(), seed=0)
    picture = robot.sense().rgb
    robot.close()
    return cv2.resize(picture, SIZE, interpolation=cv2.INTER_AREA)


def save(name: str, *rows: Sequence[NDArray[np.uint8]]) -> None:
    """Save images in rows as one file."""
    sheet = np.vstack([np.hstack(row) for row in rows])
    cv2.imwrite(str(IMAGES / name), sheet[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])


if __name__ == "__main__":
    main()
