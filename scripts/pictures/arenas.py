"""Draw the pictures for arenas.md, networks.md and tutorial-arena.md: arenas, views in arenas, and elements."""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Rgb
from pipeline.lettering import IN_MIDDLE, write
from sarsim.arenas.load import load_arena
from sarsim.arenas.random_arena import RandomArenaConfig
from sarsim.assets import asset
from sarsim.environment import RescueEnvironment
from sarsim.plugins.fiducials.tags import hang_fiducials
from sarsim.sensors.rendering import Renderer
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from scripts.pictures.layout import IMAGES, INK, beside, blank, on_background, save, scaled, stacked

DOCS = IMAGES.parent
SIZE = (800, 600)
ELEMENT_SIZE, PICTURES_PER_ROW, NAME_HEIGHT = (172, 120), 9, 24
"""Size of an element's picture, pixels; number of pictures in a row; height of the line with the name, pixels."""
HIDDEN_GROUP = 3
"""Geom group that is not drawn."""


def draw() -> None:
    """Draw all arenas, and the library of elements."""
    draw_elements()
    save_rows("arena-nist.jpg", [overview("nist_6x4"), robot_view("nist_6x4", None)])
    save_rows(
        "arena-raf.jpg",
        [overview(str(DOCS / "example.raf")), robot_view(str(DOCS / "example.raf"), (6.0, 1.1, 100.0))],
    )
    first = str(DOCS / "first.raf")
    save_rows("arena-first.jpg", [overview(first), robot_view(first, None)])
    flat, decks, clutter, fields = (overview(f"random:{seed}") for seed in (8, 1, 6, 7))
    save_rows("arenas-random.jpg", [flat, decks], [clutter, fields])
    large = RandomArenaConfig(columns=12, rows=9, victims=6, difficulty=3)
    roofed = RandomArenaConfig(ceiling=True, difficulty=1)
    save_rows("arenas-more.jpg", [overview("random:11", large), robot_view("random:3", None, roofed)])
    furnished = RandomArenaConfig(columns=9, rows=7, furniture=0.25)
    rooms = RandomArenaConfig(wall_density=0.2, ramps=0.15, clutter=0.05, victims=2, furnished=0.35)
    save_rows("furnished-rooms.jpg", [overview(f"random:{seed}", rooms) for seed in (4, 7)])
    tags = [robot_view("nist_6x4", start, fiducials=8) for start in ((-2.5, -1.3, -30.0), (1.6, -1.3, 10.0))]
    save_rows("arena-fiducial.jpg", tags)
    save_rows("arenas-furniture.jpg", [overview("random:16", furnished), robot_view("random:5", None, furnished)])


def draw_elements() -> None:
    """Draw each element of the library on its own ground, with its name."""
    model = mujoco.MjModel.from_xml_path(str(asset("arenas", "elements.xml")))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    model.geom_size[model.geom_bodyid == 0, :2] = 100  # So that no element stands at the ground's edge
    groups, pictures = model.geom_group.copy(), []
    with Renderer(model, 2 * ELEMENT_SIZE[0], 2 * ELEMENT_SIZE[1]) as renderer:
        for body in range(1, model.nbody):
            is_own = model.body_rootid[model.geom_bodyid] == body
            if not is_own.any():
                continue
            model.geom_group[:] = np.where(is_own | (model.geom_bodyid == 0), groups, HIDDEN_GROUP)
            picture = scaled(renderer.colour(data, view_of(data, model, is_own)), 0.5)
            name = blank(ELEMENT_SIZE[0], NAME_HEIGHT)
            write(name, (ELEMENT_SIZE[0] // 2, NAME_HEIGHT // 2), model.body(body).name, 14, INK, IN_MIDDLE)
            pictures.append(np.vstack([picture, name]))
    rows = (beside(*pictures[n : n + PICTURES_PER_ROW]) for n in range(0, len(pictures), PICTURES_PER_ROW))
    save("arena-elements.jpg", stacked(*rows))


def view_of(data: mujoco.MjData, model: mujoco.MjModel, is_own: NDArray[np.bool_]) -> mujoco.MjvCamera:
    """A view of all geoms of an element."""
    centres, radii = data.geom_xpos[is_own], model.geom_rbound[is_own, None]
    low, high = (centres - radii).min(axis=0), (centres + radii).max(axis=0)
    low[2] = max(low[2], 0.0)
    view = mujoco.MjvCamera()
    view.lookat[:], view.azimuth, view.elevation = (low + high) / 2, 115, -32
    view.distance = 0.93 * float(np.linalg.norm(high - low))
    return view


def overview(name: str, random: RandomArenaConfig | None = None) -> Rgb:
    """(H, W, 3) image of the whole arena, with the robot at its start."""
    environment = RescueEnvironment(load_arena(name, random=random))
    model = environment.physics.model.ptr
    with Renderer(model, *SIZE) as renderer:
        picture = on_background(renderer.colour(environment.physics.data.ptr, "overview"))
    environment.close()
    return picture


def robot_view(
    name: str, start: tuple[float, float, float] | None, random: RandomArenaConfig | None = None, fiducials: int = 0
) -> Rgb:
    """(H, W, 3) image from the robot's camera at a start pose."""
    arena = load_arena(name, start, random)
    hang_fiducials(arena, fiducials, seed=0)
    robot = SimulatedRobot(arena, SimulationConfig(), seed=0)
    picture = robot.sense().rgb
    robot.close()
    return scaled(picture, SIZE[1] / len(picture))


def save_rows(name: str, *rows: Sequence[Rgb]) -> None:
    """Save images in rows as one file."""
    save(name, stacked(*(beside(*row) for row in rows)))
