"""Files handed in for a room of 4 × 4 m around the origin, with walls of 1 m; the robot started in its middle."""

from datetime import datetime

import numpy as np

from pipeline.grid_map import Grid
from pipeline.metric_map.metric_map import MetricMap
from pipeline.plugins.league.brief import MissionBrief
from pipeline.plugins.league.cloud import write_cloud
from pipeline.plugins.league.hand_in import league_frame
from pipeline.plugins.league.plan import SearchedGround, write_league_map
from pipeline.plugins.league.pois import points_of_interest, write_pois
from pipeline.tracks.find import Find

BRIEF = MissionBrief(team="Team, 'B'", country='Côte "d\'Or"', name="lab", start=datetime(2026, 1, 26, 14, 30))
FRONT = 0.25
T_MAP_LEAGUE = league_frame(np.eye(4), FRONT)
PATH = np.array([(0.0, 0, 0), (1.0, 0, 0)])


def found(kind, text, position, time, confidence):
    photo = np.zeros((1, 1, 3), np.uint8)
    return Find(kind, text, np.array(position), 0.01 * np.eye(3), time, confidence, photo)


FINDS = [
    found("april_tag", "12", [1.0, 1.0, 0.3], 10.0, 1.0),
    found("hazmat_sign", "poison", [-1.0, 1.0, 0.3], 8.4, 0.8),
    found("hazmat_sign", "poison", [-1.1, 1.0, 0.3], 7.0, 0.6),
    found("victim", "", [1.0, -1.0, 0.2], 20.0, 0.9),
    found("heat", "", [1.0, -1.0, 0.2], 20.0, 0.9),
    found("qr_code", 'a,"b"', [0.0, 1.9, 0.5], 5.0, 1.0),
]


def room_points():
    """(N, 3) m in ``map``: the floor and the walls, a point every 5 cm."""
    across = np.arange(-1.975, 2, 0.05)
    x, y = (a.ravel() for a in np.meshgrid(across, across))
    floor = np.stack([x, y, 0 * x], axis=1)
    u, z = (a.ravel() for a in np.meshgrid(across, np.arange(0.025, 1, 0.05)))
    walls = [np.stack(p, axis=1) for s in (-2.0, 2.0) for p in ((s + 0 * u, u, z), (u, s + 0 * u, z))]
    return np.concatenate([floor, *walls])


def room_map():
    """A metric map in which the floor is occupied."""
    metric_map = MetricMap()
    floor = metric_map.voxel_index([(-2, -2, 0), (2, 2, 0)])
    metric_map.set_log_odds(floor[0], np.full((*(floor[1] - floor[0])[:2] + 1, 1), 40, np.int8))
    return metric_map


def room_ground():
    """The floor, searched with a confidence of ¾, walls around it, and unknown ground beyond."""
    grid = Grid(np.array([-50, -50]), 0.05, (100, 100))
    middle = np.abs(grid.centre_of(np.indices(grid.shape).transpose(1, 2, 0))).max(axis=-1)
    return SearchedGround(grid, (middle > 2) & (middle < 2.05), np.where(middle < 2.05, 0.75, 0.0))


def room_pois():
    return points_of_interest(FINDS, T_MAP_LEAGUE, BRIEF.start)


def hand_in_room(folder, points=None, brief=BRIEF):
    """Write the three files into a folder; returns their paths."""
    points = room_points() if points is None else points
    map_2d, cloud, pois = (folder / name for name in (brief.map_2d_name, brief.cloud_name, brief.pois_name))
    write_league_map(map_2d, room_ground(), T_MAP_LEAGUE, PATH, room_pois())
    colours = np.full(points.shape, 200, np.uint8)
    write_cloud(cloud, brief, points, colours, np.array([[0, 0, 0.6]]), room_map(), T_MAP_LEAGUE, 20)
    write_pois(pois, brief, room_pois())
    return map_2d, cloud, pois
