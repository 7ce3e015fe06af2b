"""Write the map of an episode for other programs: ``export_map.py EPISODE --out FILE.bt|.ot|.ply|.pgm``."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from pipeline.errors import InputError
from sarsim.scripts.cli import run

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pipeline.metric_map.metric_map import MetricMap


def export_map(path: Annotated[Path, tyro.conf.Positional], out: Path) -> None:
    """Write the occupancy grid of an episode as OctoMap, as a point cloud, or as a 2D map for ROS map_server.

    Args:
        path: folder of the episode, or its metric_map.npz; a semantic_map.ply beside that gives the classes.
        out: the file to write. By its ending: .bt is OctoMap's free and occupied space; .ot the same with log-odds,
            coloured by class; .ply the centres of the occupied voxels, coloured by class; .pgm a 2D map, with a
            .yaml beside it.
    """
    if out.suffix not in (".bt", ".ot", ".ply", ".pgm"):
        raise InputError(f"--out {out}: the ending must be .bt, .ot, .ply or .pgm")
    from pipeline.metric_map.io.exports import save_map_server, save_ply
    from pipeline.metric_map.io.npz import load_metric_map
    from pipeline.metric_map.io.octomap import write_bt, write_ot

    path = path / "metric_map.npz" if path.is_dir() else path
    metric_map = load_metric_map(path)
    semantic_map = path.with_name("semantic_map.ply")
    match out.suffix:
        case ".pgm":
            save_map_server(out, metric_map)
        case ".bt":
            write_bt(out, metric_map)
        case ".ot":
            write_ot(out, metric_map, _labels(metric_map, semantic_map))
        case ".ply":
            save_ply(out, metric_map, _labels(metric_map, semantic_map))


def _labels(metric_map: "MetricMap", path: Path) -> "NDArray[np.uint8] | None":
    """Classes of the occupied voxels, from a semantic map if there is one."""
    if not path.exists():
        return None
    import open3d

    from pipeline.metric_map.io.octomap import voxel_labels

    cloud = open3d.t.io.read_point_cloud(path).point
    if "label" not in cloud:
        raise InputError(f"{path}: not a semantic map: its points have no label")
    labels = cloud.label.numpy().reshape(-1).astype("uint8")
    return voxel_labels(metric_map, cloud.positions.numpy(), labels)


def main() -> None:
    """Entry point."""
    run(export_map)


if __name__ == "__main__":
    main()
