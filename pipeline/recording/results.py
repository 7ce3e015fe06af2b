"""The files that a mapper leaves, of an episode or of a recording."""

from pathlib import Path

from pipeline.mapper import Mapper
from pipeline.metric_map.io.npz import save_metric_map
from pipeline.recording.map_file import save_keyframes

KEYFRAMES = "keyframes.npz"  # In a folder of results, what ``--map`` reads


def save_maps(mapper: Mapper, folder: Path) -> None:
    """Write every map into a folder; InputError where one cannot be written."""
    save_keyframes(mapper, folder / KEYFRAMES)
    save_metric_map(mapper.metric_map, folder / "metric_map.npz")
    mapper.semantic_map.save(folder / "semantic_map.ply")
    mapper.topological_map.save(folder / "topology.json")
