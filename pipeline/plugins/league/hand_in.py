"""Write the files that the leagues require, from the maps and finds at the end of a run."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Points, Pose, Poses
from pipeline.elevation_map.traversability import Traversability
from pipeline.errors import InputError
from pipeline.files import run_all
from pipeline.labels import COLOURS, Label
from pipeline.metric_map.metric_map import MetricMap
from pipeline.plugins.league.brief import HANDED_IN, MissionBrief
from pipeline.plugins.league.cloud import write_cloud
from pipeline.plugins.league.codes import codes_among, write_codes
from pipeline.plugins.league.config import LeagueConfig
from pipeline.plugins.league.plan import searched_ground, write_league_map
from pipeline.plugins.league.pois import points_of_interest, write_pois
from pipeline.semantic_map.semantic_map import SemanticMap
from pipeline.sink import Result, Sink
from pipeline.tracks.find import Find
from pipeline.transforms import from_yaw


class LeagueFiles(Sink):
    """Writes the files that a league requires."""

    finishing = "writing the league's files"

    def __init__(self, brief: MissionBrief, *, config: LeagueConfig = LeagueConfig()):
        self._brief, self._config = brief, config

    def finish(self, result: Result) -> None:
        """Write the files, even if one of them fails; InputError if one cannot be written."""
        if result.steps:
            mapper, begin = result.mapper, result.trajectory.begin
            # A robot that never moved has no odometry between keyframes.
            driven = np.array(result.trajectory.estimated() or mapper.keyframes.poses)
            finds = [*(person.to_find() for person in mapper.victims.confirmed), *mapper.finds.reported]
            maps = mapper.metric_map, mapper.semantic_map, mapper.traversability
            hand_in(result.folder, self._brief, driven, finds, *maps, begin=begin, config=self._config)


def hand_in(
    folder: Path,
    brief: MissionBrief,
    driven: Poses,
    finds: Sequence[Find],
    metric_map: MetricMap,
    semantic_map: SemanticMap,
    ground: Traversability,
    *,
    begin: float = 0.0,
    config: LeagueConfig = LeagueConfig(),
) -> list[Path]:
    """Write ``handed_in/`` into the folder of a run; if a file fails, the others are written nevertheless.

    Args:
        folder: the run's folder.
        brief: the mission's brief.
        driven: poses ``T_map_base`` along the robot's path, at least one; the first is the start pose.
        finds: the finds to report, confirmed people included.
        metric_map: determines the confidence of points and of the ground.
        semantic_map: its points form the 3D map; if it is empty, the occupied voxels do.
        ground: traversability of the robot's elevation map.
        begin: time of the start of the run on the robot's clock, s.
        config: parameters of the files.

    Returns:
        The files: 2D map, 3D map, list of finds, and QR codes if any were read.

    Raises:
        InputError: a file cannot be written.
    """
    target = folder / HANDED_IN
    try:
        target.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(f"{target}: the folder cannot be created: {error.strerror or error}") from error
    way, robot = driven[:, :3, 3], ground.robot
    cameras, T = way + np.array([0.0, 0.0, robot.headroom]), league_frame(driven[0], robot.half_length)
    pois = points_of_interest(finds, T, brief.start, begin)
    map_2d, cloud, listed = files = [target / name for name in (brief.map_2d_name, brief.cloud_name, brief.pois_name)]
    neighbours = config.normal_neighbours
    if codes := codes_among(finds, T):
        files.append(target / brief.codes_name)
    run_all(
        lambda: write_pois(listed, brief, pois),
        lambda: write_cloud(cloud, brief, *_surface(semantic_map, metric_map), cameras, metric_map, T, neighbours),
        lambda: write_league_map(map_2d, searched_ground(ground, metric_map, way[:, :2]), T, way, pois),
        *(partial(write_codes, path, codes) for path in files[3:]),
    )
    return files


def league_frame(T_map_start: Pose, front: float) -> Pose:
    """Pose of the league's frame: level, on the floor ``front`` m ahead of the robot's centre, with y forward."""
    x, y, z = T_map_start[:3, 3]
    forward = T_map_start[:2, 0] / np.linalg.norm(T_map_start[:2, 0])
    x, y = (x, y) + front * forward
    return from_yaw(x, y, z, float(np.arctan2(-forward[0], forward[1])))


def _surface(semantic_map: SemanticMap, metric_map: MetricMap) -> tuple[Points, NDArray[np.uint8]]:
    """(N, 3) m, points of the semantic map or, if it is empty, of the occupied voxels, and (N, 3) their colours."""
    if len(semantic_map):
        return semantic_map.points(), COLOURS[semantic_map.labels()]
    centres = metric_map.occupied_centres()
    return centres, np.tile(COLOURS[Label.UNLABELLED], (len(centres), 1))
