"""Write the map of an episode for other programs: ``export_map.py EPISODE --out FILE.bt|.ot|.ply|.pgm|.tif|…``."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from pipeline.errors import InputError
from sarsim.commands.cli import run
from sarsim.flags import Given
from sarsim.settings import RobotName

MAP_2D_SUFFIXES = (".pgm", ".tif", ".png")  # File extensions of 2D maps

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pipeline.metric_map.metric_map import MetricMap


def export_map(
    path: Annotated[Path, tyro.conf.Positional],
    out: Path,
    heights: Given[tuple[float, float]] = None,
    robot: RobotName = "pioneer3at",
) -> None:
    """Write the map of an episode as OctoMap, as a point cloud, or as a 2D map for ROS or GIS.

    Args:
        path: folder of the episode, or its metric_map.npz. Classes come from semantic_map.ply and the ground from
            keyframes.npz in the same folder.
        out: file to write; its extension sets the format. .bt: OctoMap of free and occupied space. .ot: OctoMap with
            log-odds, coloured by class. .ply: centres of occupied voxels, coloured by class. .pgm: ground that is
            free, lethal or unknown to the robot, with a .yaml file, and slopes as costs in ..._cost.png. .tif, .png:
            the same ground as a GeoTIFF or a PNG with a world file.
        heights: for .pgm, show a slice of the occupancy grid from the lower to the upper height, m, instead of the
            ground. A slice ignores ramps; 0.25 0.65 shows obstacles on level ground.
        robot: robot that determines which ground is traversable: pioneer3at, jackal, or the path of an MJCF file.
    """
    *endings, last = ".bt", ".ot", ".ply", *MAP_2D_SUFFIXES
    if out.suffix not in (*endings, last):
        raise InputError(f"--out {out}: the file name must end in {', '.join(endings)} or {last}")
    if heights is not None and out.suffix != ".pgm":
        raise InputError(f"--heights {heights[0]:g} {heights[1]:g}: requires an --out file that ends in .pgm")
    if heights is not None and not heights[0] < heights[1]:
        raise InputError(f"--heights {heights[0]:g} {heights[1]:g}: the first height must be below the second")
    path = path / "metric_map.npz" if path.is_dir() else path
    is_of_ground = out.suffix in MAP_2D_SUFFIXES and heights is None
    files = _export_ground(path, out, robot) if is_of_ground else _export_voxels(path, out, heights)
    print(f"Wrote {', '.join(map(str, files))}")


def _export_voxels(path: Path, out: Path, heights: tuple[float, float] | None) -> list[Path]:
    """Write the occupancy grid or a slice of it, and return the files."""
    from pipeline.metric_map.io.exports import save_map_server, save_ply
    from pipeline.metric_map.io.npz import load_metric_map
    from pipeline.metric_map.io.octomap import write_bt, write_ot

    metric_map = load_metric_map(path)
    if heights is not None:
        return save_map_server(out, metric_map, *heights)
    semantic_map = path.with_name("semantic_map.ply")
    if out.suffix in (".bt", ".ot"):
        x, y, z = metric_map.corner
        print(f"{out}: OctoMap coordinates start at 0 0 0; add {x:g} {y:g} {z:g} m to get map coordinates")
    match out.suffix:
        case ".bt":
            write_bt(out, metric_map)
        case ".ot":
            write_ot(out, metric_map, _labels(metric_map, semantic_map))
        case ".ply":
            save_ply(out, metric_map, _labels(metric_map, semantic_map))
    return [out]


def _export_ground(path: Path, out: Path, robot: RobotName) -> list[Path]:
    """Write a 2D map of the ground's traversability for the robot, and return the files."""
    from pipeline.elevation_map.traversability import assess_map
    from pipeline.map_file import load_elevation_map
    from pipeline.metric_map.io.plans import save_geotiff, save_world_png
    from pipeline.metric_map.io.ros_map import known_costs, save_ros_map, trinary
    from sarsim.robots.model import robot_model

    keyframes = path.with_name("keyframes.npz")
    if not keyframes.exists():
        instead = (
            "; --heights 0.25 0.65 exports a slice of the occupancy grid instead" if out.suffix == ".pgm" else ""
        )
        raise InputError(f"{keyframes}: no such file, but it is needed for the ground{instead}")
    elevation_map, poses = load_elevation_map(keyframes, robot_model(robot))
    ground, places = assess_map(elevation_map), poses[:, :2, 3]
    if out.suffix == ".pgm":
        return save_ros_map(out, ground, places)
    cost, origin = known_costs(ground, places)
    save = save_geotiff if out.suffix == ".tif" else save_world_png
    return save(out, trinary(cost), ground.grid.cell, origin)


def _labels(metric_map: "MetricMap", path: Path) -> "NDArray[np.uint8] | None":
    """Classes of the occupied voxels, from the semantic map at ``path``; None if the file does not exist."""
    if not path.exists():
        return None
    import numpy as np

    from pipeline.labels import Label
    from pipeline.metric_map.io.octomap import voxel_labels
    from pipeline.semantic_map.ply import read_ply

    vertices = read_ply(path)
    points, labels = np.stack([vertices[axis] for axis in "xyz"], axis=1), vertices["label"]
    if not np.isfinite(points).all() or labels.max(initial=0) >= len(Label):
        raise InputError(
            f"{path}: not a semantic map: points must be finite and labels between 0 and {len(Label) - 1};"
            " remove the file to export the map without classes"
        )
    return voxel_labels(metric_map, points, labels)


def main() -> None:
    """Entry point of ``sarsim-export-map``."""
    run(export_map)
