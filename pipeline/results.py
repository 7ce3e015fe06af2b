"""The files of a mapper's results, from an episode or a recording."""

from pathlib import Path

from pipeline.files import each
from pipeline.map_file import save_keyframes
from pipeline.mapper import Mapper
from pipeline.metric_map.io.npz import save_metric_map

KEYFRAMES = "keyframes.npz"  # The file that ``--map`` reads in a folder of results


def save_maps(mapper: Mapper, folder: Path) -> None:
    """Write every map into a folder, each by itself; then InputError if one could not be written."""
    each(
        lambda: save_keyframes(mapper, folder / KEYFRAMES),
        lambda: save_metric_map(mapper.metric_map, folder / "metric_map.npz"),
        lambda: mapper.semantic_map.save(folder / "semantic_map.ply"),
        lambda: mapper.topological_map.save(folder / "topology.json"),
    )
