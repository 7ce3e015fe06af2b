"""Build the laboratory floor, ``assets/arenas/esogu_52x15.xml``, from its plan in ``scripts/assets/esogu``."""

import sys
from collections.abc import Iterable
from pathlib import Path
from xml.etree.ElementTree import Comment, Element, SubElement, indent, tostring

import numpy as np

from pipeline.files import atomic_write
from sarsim.arenas.elements import ArenaBuilder
from sarsim.assets import asset
from sarsim.commands.cli import run
from sarsim.victims.mjcf import numbers
from sarsim.victims.victims import make_victim

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # scripts/ is not installed
from scripts.assets.esogu import building, plan
from scripts.assets.esogu.furniture import PIECES
from scripts.assets.esogu.parts import Part, moved

PEOPLE_SEED = 52  # Seed of the victims' builds, clothes and poses
HALF_TILE = 0.6
FLOOR_GRID = 0.8  # Spacing of the floor's rendering grid, m; the lamp's light is computed at its vertices
QUADS = "2"  # Quads per row of a box's face; most of the rendering time is spent on their vertices
CEILING_GROUP = "2"  # Geom group; the key 2 hides it in MuJoCo's viewer
LIGHTS = (
    # Name, direction, diffuse colour; for the light from the lamps, from the windows, and reflected by the floor
    ("lamps", (-0.25, 0.4, -0.88), (0.52, 0.52, 0.5)),
    ("windows", (0.45, -0.75, -0.5), (0.26, 0.27, 0.29)),
    ("floor_bounce", (0.2, 0.3, 0.93), (0.3, 0.3, 0.29)),
)
CAMERAS = (
    ("top", {"pos": "0 0 52", "fovy": "45"}),
    ("overview", {"pos": "0 -38 43", "xyaxes": "1 0 0 0 0.75 0.66", "fovy": "45"}),
)
TARGET = asset("arenas", "esogu_52x15.xml")
VICTIMS = "esogu_52x15_victims.xml"


TEXTURES = (
    # MuJoCo maps 2D textures onto the x-y plane of a geom, which suits floors.
    {"name": "floor_tiles", "rgb1": "0.62 0.63 0.64", "mark": "edge", "markrgb": "0.48 0.49 0.50"},
)
TILES_PER_METRE = "3.3333 3.3333"
SURFACE_COLOURS = {
    "plaster": (0.87, 0.86, 0.81), "column": (0.76, 0.76, 0.74), "frame": (0.93, 0.93, 0.93),
    "glass": (0.66, 0.79, 0.88), "door": (0.58, 0.39, 0.22), "door_frame": (0.44, 0.29, 0.17),
    "cabinet": (0.20, 0.36, 0.60), "cabinet_door": (0.25, 0.43, 0.68), "locker_door": (0.42, 0.52, 0.60),
    "worktop": (0.80, 0.80, 0.78), "wood": (0.74, 0.58, 0.38), "dark_wood": (0.46, 0.31, 0.19),
    "steel": (0.55, 0.57, 0.59), "grey": (0.66, 0.68, 0.68), "instrument": (0.86, 0.85, 0.79),
    "screen": (0.10, 0.16, 0.20), "fabric": (0.18, 0.22, 0.32), "concrete": (0.56, 0.55, 0.53),
    "motor": (0.20, 0.45, 0.35), "generator": (0.24, 0.35, 0.55), "cork": (0.66, 0.48, 0.30),
    "terracotta": (0.66, 0.34, 0.22), "leaf": (0.20, 0.44, 0.18), "book_red": (0.56, 0.17, 0.15),
    "book_blue": (0.20, 0.29, 0.50),
}  # fmt: skip
"""Colours of the materials; these replace materials of the same name from the element library."""


def make_esogu(folder: Path = TARGET.parent) -> None:
    """Write the arena, and beside it the victims that it includes."""
    for name, text in (TARGET.name, laboratory_floor().to_xml()), (VICTIMS, people_on_the_floor()):
        with atomic_write(folder / name) as path:
            path.write_text(text)


def laboratory_floor() -> ArenaBuilder:
    """The building, its furniture, the robot's course and its start."""
    builder = ArenaBuilder("esogu_52x15")
    _add_materials(builder.root)
    SubElement(builder.root, "include", file=VICTIMS)
    _add_surroundings(builder.root)
    _add_building(_world(builder))
    for room, places in plan.FURNITURE.items():
        _add_furniture(_world(builder), room, places)
    _add_course(builder)
    builder.set_start((*plan.START, 0.0), 0.0)
    return builder


def people_on_the_floor() -> str:
    """The victims as MJCF, which the arena includes."""
    root = Element("mujocoinclude")
    for number, victim in enumerate(plan.VICTIMS, 1):
        rng = np.random.default_rng([PEOPLE_SEED, number])
        model = make_victim(str(number), rng, victim.posture, victim.placement)
        model.add_to(root, (victim.x, victim.y, 0.0), np.radians(victim.yaw))
    indent(root, " ")
    return tostring(root, encoding="unicode") + "\n"


def _world(builder: ArenaBuilder) -> Element:
    world = builder.root.find("worldbody")
    assert world is not None
    return world


def _add_materials(root: Element) -> None:
    assets = root.find("asset")
    assert assets is not None
    for same_name in [m for m in assets.findall("material") if m.get("name") in SURFACE_COLOURS]:
        assets.remove(same_name)
    for texture in TEXTURES:
        flat = {"type": "2d", "builtin": "flat", "width": "64", "height": "64"}
        SubElement(assets, "texture", texture | flat)
        tiled = {"texture": texture["name"], "texuniform": "true", "texrepeat": TILES_PER_METRE}
        SubElement(assets, "material", {"name": texture["name"], "specular": "0.1"} | tiled)
    SubElement(assets, "material", {"name": "lamp", "rgba": "1 1 0.97 1"})
    for name, rgb in SURFACE_COLOURS.items():
        SubElement(assets, "material", {"name": name, "rgba": numbers((*rgb, 1)), "specular": "0.1"})


def _add_surroundings(root: Element) -> None:
    """Add lights and cameras. No light casts shadows: that costs a render pass, and the ceiling would block it."""
    SubElement(root, "statistic", center="0 0 0.5", extent="15")
    quality, world = root.find("visual/quality"), root.find("worldbody")
    assert quality is not None and world is not None
    quality.set("numquads", QUADS)
    for name, direction, diffuse in LIGHTS:
        attributes = {"name": name, "directional": "true", "castshadow": "false"}
        colours = {"diffuse": numbers(diffuse), "specular": "0.1 0.1 0.1"}
        SubElement(world, "light", attributes | {"dir": numbers(direction)} | colours)
    for name, attributes in CAMERAS:
        SubElement(world, "camera", {"name": name} | attributes)


def _add_building(world: Element) -> None:
    half = (building.LENGTH / 2, building.BUILDING_WIDTH / 2, FLOOR_GRID)
    floor = {"name": "floor", "class": "terrain", "material": "floor_tiles", "size": numbers(half)}
    SubElement(world, "geom", floor)
    inner = building.BUILDING_WIDTH / 2 - building.OUTER
    half_wall = building.INNER / 2
    shell = {
        "outer": building.outer_walls(plan.SOUTH_ROOMS, plan.NORTH_ROOMS),
        "corridor_south": building.corridor_wall(building.SOUTH_WALL, -1, plan.SOUTH_ROOMS),
        "corridor_north": building.corridor_wall(building.NORTH_WALL, 1, plan.NORTH_ROOMS),
        "south": building.partitions(plan.SOUTH_ROOMS, -inner, building.SOUTH_WALL - half_wall),
        "north": building.partitions(plan.NORTH_ROOMS, building.NORTH_WALL + half_wall, inner),
        "column": building.columns(plan.COLUMNS),
        "ceiling": building.ceiling(),
    }
    for name, parts in shell.items():
        world.append(Comment(f" {name} "))
        _append(world, name, parts)
    for geom in world.iterfind("geom[@class='ceiling']"):
        geom.set("group", CEILING_GROUP)


def _add_furniture(world: Element, room: str, places: list[plan.Place]) -> None:
    world.append(Comment(f" {room} "))
    for number, (kind, x, y, yaw) in enumerate(places):
        _append(world, f"{room.replace(' ', '_')}_{number}_{kind}", moved(PIECES[kind], x, y, yaw))


def _append(world: Element, name: str, parts: Iterable[Part]) -> None:
    world.extend(part.element(f"{name}_{number}") for number, part in enumerate(parts))


def _add_course(builder: ArenaBuilder) -> None:
    _world(builder).append(Comment(" course "))
    for kind, x, y, yaw in plan.COURSE:
        if kind == "ridge":
            dx, dy = HALF_TILE * np.cos(np.radians(yaw)), HALF_TILE * np.sin(np.radians(yaw))
            builder.add_element("ramp_17", (x - dx, y - dy, 0), yaw + 90)
            builder.add_element("ramp_17", (x + dx, y + dy, 0), yaw - 90)
        else:
            builder.add_element(kind, (x, y, 0), yaw)


def main() -> None:
    """Entry point."""
    run(make_esogu)


if __name__ == "__main__":
    main()
