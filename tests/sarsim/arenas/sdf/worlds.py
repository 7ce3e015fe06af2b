"""Small SDF worlds, and rays that measure them."""

from pathlib import Path

import mujoco
import numpy as np

from pipeline.labels import Label
from sarsim.arenas.sdf.build import build_sdf
from sarsim.sensors.camera import geom_labels

PLANE = "<include><uri>model://ground_plane</uri></include>"


def box(x, y, z, pose="", tag="collision"):
    """A shape of a box with sides in m."""
    return f"<{tag} name='c'><pose>{pose}</pose><geometry><box><size>{x} {y} {z}</size></box></geometry></{tag}>"


def model(name, *links, pose="", inside=""):
    """A model, ``links`` being what stands in each of its links."""
    written = "".join(f"<link name='l{n}'>{link}</link>" for n, link in enumerate(links))
    return f"<model name='{name}'><pose>{pose}</pose>{written}{inside}</model>"


def write(folder: Path, *content: str, name="a.world", version="1.9") -> Path:
    """Write a world of this content."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"<sdf version='{version}'><world name='w'>{''.join(content)}</world></sdf>")
    return path


class Compiled:
    """An arena in MuJoCo, without a start."""

    def __init__(self, path: Path):
        self.model = mujoco.MjModel.from_xml_string(build_sdf(path).to_xml())
        self.data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, self.data)

    @property
    def labels(self) -> list[str]:
        """The names of the geoms' labels, in order."""
        return [Label(label).name.lower() for label in geom_labels(self.model)]

    def ray(self, *point: float, along: tuple[float, float, float]) -> float:
        """Distance in m from a point to the first surface in a direction; -1 if there is none."""
        geom = np.zeros(1, np.int32)
        return mujoco.mj_ray(
            self.model, self.data, np.array(point, float), np.array(along, float), None, 1, -1, geom, None
        )
