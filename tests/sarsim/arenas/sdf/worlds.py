"""Small SDF worlds, and rays that measure them."""

from pathlib import Path

import mujoco
import numpy as np
import trimesh

from pipeline.labels import Label
from sarsim.arenas.sdf.build import build_sdf
from sarsim.arenas.sdf.pieces import extruded
from sarsim.sensors.camera import geom_labels

PLANE = "<include><uri>model://ground_plane</uri></include>"

COLLADA = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimeter" meter="0.01"/>{axis}</asset>
<library_effects><effect id="e"><profile_COMMON><technique sid="t"><phong><diffuse><color>0 0.5 1 1</color></diffuse>
</phong></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g" name="slab"><mesh>
<source id="p"><float_array id="a" count="24">0 0 0 100 0 0 100 200 0 0 200 0 0 0 300 100 0 300 100 200 300 0 200 300
</float_array><technique_common><accessor source="#a" count="8" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist material="k" count="6"><input semantic="VERTEX" source="#v" offset="0"/><vcount>4 4 4 4 4 4</vcount>
<p>0 3 2 1 4 5 6 7 0 1 5 4 1 2 6 5 2 3 7 6 3 0 4 7</p></polylist></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><translate>50 0 0</translate><rotate>0 0 1 90</rotate>
<instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="k" target="#m"/>
</technique_common></bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
"""A slab of 1 m × 2 m × 3 m in cm, turned by 90° and shifted by 0.5 m along x; {axis} says which axis is up."""


def box(x, y, z, pose="", tag="collision"):
    """A shape of a box with sides in m."""
    return f"<{tag} name='c'><pose>{pose}</pose><geometry><box><size>{x} {y} {z}</size></box></geometry></{tag}>"


def model(name, *links, pose="", inside=""):
    """A model, ``links`` being what stands in each of its links."""
    written = "".join(f"<link name='l{n}'>{link}</link>" for n, link in enumerate(links))
    return f"<model name='{name}'><pose>{pose}</pose>{written}{inside}</model>"


def include(uri, name="", pose=""):
    """A model from elsewhere, with its own name and pose if none is given."""
    more = (f"<name>{name}</name>" if name else "") + (f"<pose>{pose}</pose>" if pose else "")
    return f"<include><uri>{uri}</uri>{more}</include>"


def write(folder: Path, *content: str, name="a.world", version="1.9") -> Path:
    """Write a world of this content."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"<sdf version='{version}'><world name='w'>{''.join(content)}</world></sdf>")
    return path


def mesh(uri: str, more: str = "") -> str:
    """A shape of a mesh."""
    return f"<collision name='c'><geometry><mesh><uri>{uri}</uri>{more}</mesh></geometry></collision>"


def room() -> trimesh.Trimesh:
    """Walls 1.5 m high around 3.6 × 2.6 m, as one non-convex piece with a doorway in the wall at +x."""
    outline = [(-2, -1.5), (2, -1.5), (2, -0.5), (1.8, -0.5), (1.8, -1.3), (-1.8, -1.3), (-1.8, 1.3), (1.8, 1.3)]
    outline = np.array([*outline, (1.8, 0.5), (2, 0.5), (2, 1.5), (-2, 1.5)])
    ring, count = extruded([outline], 1.5), len(outline)
    caps = ring.triangles.reshape(-1, 8, 3)[:, :2].reshape(-1, 3) + 2 * count
    here, after = np.arange(count), np.roll(np.arange(count), -1)
    sides = np.stack([here, after, after + count, here, after + count, here + count], axis=1).reshape(-1, 3)
    levels = [np.pad(outline, ((0, 0), (0, 1)), constant_values=z) for z in (0, 1.5)]
    walls = trimesh.Trimesh(np.concatenate([*levels, ring.vertices]), np.concatenate([sides, caps]))
    assert walls.is_watertight and not walls.is_convex
    return walls


class Compiled:
    """An arena in MuJoCo, without a start."""

    def __init__(self, path: Path):
        builder = build_sdf(path)
        self.model = mujoco.MjModel.from_xml_string(builder.to_xml(), builder.files)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, self.data)

    @property
    def labels(self) -> list[str]:
        """The names of the geoms' labels, in order."""
        return [Label(label).name.lower() for label in geom_labels(self.model)]

    def label_below(self, x: float, y: float) -> Label:
        """The label of the highest surface at a place, m."""
        geom = np.zeros(1, np.int32)
        point, down = np.array([x, y, 99.0]), np.array([0, 0, -1.0])
        mujoco.mj_ray(self.model, self.data, point, down, None, 1, -1, geom, None)
        return Label(geom_labels(self.model)[geom[0]])

    def ray(self, *point: float, along: tuple[float, float, float]) -> float:
        """Distance in m from a point to the first surface that is drawn in a direction; -1 if there is none."""
        geom, drawn = np.zeros(1, np.int32), np.array([1, 1, 1, 0, 0, 0], np.uint8)
        return mujoco.mj_ray(
            self.model, self.data, np.array(point, float), np.array(along, float), drawn, 1, -1, geom, None
        )
