"""The 3D map in the league's format: an ASCII PLY in metres, with colours, normals and confidence."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import small_gicp
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from scipy.special import expit

from pipeline.arrays import Directions, Places, Points, Pose, Values
from pipeline.files import MAX_MEMORY, atomic_write, read_bytes
from pipeline.metric_map.metric_map import LOG_ODDS_PER_UNIT, MetricMap
from pipeline.plugins.league.brief import MissionBrief
from pipeline.transforms import inverse, transform_points

PLACE, NORMAL, RGB = ("x", "y", "z"), ("nx", "ny", "nz"), ("red", "green", "blue")
PROPERTIES = dict.fromkeys((*PLACE, *NORMAL, "confidence", "temp"), "float") | dict.fromkeys(RGB, "uchar")
"""Type of each property. It is an assumption that ``confidence`` is between 0 and 1."""
WRITTEN_PROPERTIES = (*PLACE, *RGB, *NORMAL, "confidence")  # In the order of the columns
ALIASES = {"float32": "float", "uint8": "uchar"}  # Names of types that some programs write, and the names used here
COUNT_PATTERN = re.compile(r"\d{1,18}")  # A number of vertices
COMMENTS = ("team", "start time", "mission")


@dataclass
class CloudFile:
    """The content of a PLY file, and the errors in it.

    Attributes:
        comments: comments in the header.
        columns: values of the vertices by property; x, y and z in m.
        errors: the errors, one line each.
    """

    comments: list[str] = field(default_factory=list)
    columns: dict[str, Values] = field(default_factory=dict)
    errors: list[str] = field(default_factory=list)

    def rows(self, names: tuple[str, ...] = PLACE) -> NDArray[np.float64]:
        """(N, K) values of the columns ``names``, by default positions, m; no rows if a column is missing."""
        if not all(name in self.columns for name in names):
            return np.zeros((0, len(names)))
        return np.stack([self.columns[name] for name in names], axis=1)


def write_cloud(
    path: Path,
    brief: MissionBrief,
    points: Points,
    colours: NDArray[np.uint8],
    cameras: Places,
    metric_map: MetricMap,
    T_map_league: Pose,
    neighbours: int,
) -> None:
    """Write a point cloud, either completely or not at all.

    Args:
        path: the PLY file.
        brief: the mission's brief, which supplies the comments.
        points: points on surfaces.
        colours: (N, 3) RGB.
        cameras: positions of the camera; each normal points towards the nearest position.
        metric_map: the confidence of a point is the probability that its voxel of this map is occupied.
        T_map_league: pose of the league's frame.
        neighbours: number of neighbours from which a point's normal is estimated.

    Raises:
        InputError: the file cannot be written.
    """
    confidence = expit(LOG_ODDS_PER_UNIT * metric_map.log_odds_at(metric_map.voxel_index(points)))
    T = inverse(T_map_league)
    moved, normals = transform_points(T, points), _normals(points, cameras, neighbours) @ T[:3, :3].T
    comments = (brief.team, f"{brief.start:%Y-%m-%d %H:%M:%S}", brief.name)
    lines = ["ply", "format ascii 1.0"]
    lines += [f"comment {name}: {value}" for name, value in zip(COMMENTS, comments, strict=True)]
    lines += [
        f"element vertex {len(points)}",
        *(f"property {PROPERTIES[name]} {name}" for name in WRITTEN_PROPERTIES),
        "end_header",
    ]
    table = np.column_stack([moved, colours, normals, confidence])
    form = " ".join(["%.3f"] * len(PLACE) + ["%d"] * len(RGB) + ["%.2f"] * (len(NORMAL) + 1))
    with atomic_write(path) as partial:
        np.savetxt(partial, table, form, header="\n".join(lines), comments="", encoding="utf-8")


def _normals(points: Points, cameras: Places, neighbours: int) -> Directions:
    """Normals, each pointing towards the nearest camera position."""
    if not len(points):
        return np.zeros((0, 3))
    cloud = small_gicp.PointCloud(np.asarray(points, np.float64))
    small_gicp.estimate_normals(cloud, num_neighbors=neighbours)
    normals: Directions = cloud.normals()[:, :3]
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    # A point with too few neighbours has no normal and gets an arbitrary one, which points up.
    normals = np.where(length > 0, normals / np.maximum(length, np.finfo(float).tiny), [0.0, 0.0, 1.0])
    _, nearest = cKDTree(cameras).query(points)
    away = ((cameras[nearest] - points) * normals).sum(axis=1, keepdims=True) < 0
    return np.where(away, -normals, normals)


def read_cloud(path: Path) -> CloudFile:
    """Read a point cloud, from sarsim or any other program, and note the errors for which a judge would reject it.

    Raises:
        InputError: the file is not a regular file, is too large, or cannot be read.
    """
    read = CloudFile()
    head, end, body = read_bytes(path, MAX_MEMORY).partition(b"end_header")
    lines = [line.strip() for line in head.decode(errors="replace").splitlines()]
    if not end or lines[:1] != ["ply"]:
        read.errors.append('not a PLY file: the first line must be "ply", and the header must end with "end_header"')
        return read
    if "format ascii 1.0" not in lines:
        read.errors.append('not an ASCII PLY file: the header must contain the line "format ascii 1.0"')
        return read
    read.comments = [line.removeprefix("comment").strip() for line in lines if line.startswith("comment")]
    count, names = _vertex_element(read, lines)
    _read_body(read, body.split(b"\n")[1:], count, names)
    return read


def _vertex_element(read: CloudFile, lines: list[str]) -> tuple[int, list[str]]:
    """Number of vertices, which must be the first element, and names of their properties."""
    words = [line.split() for line in lines]
    elements = [(at, w) for at, w in enumerate(words) if w[:1] == ["element"]]
    if not elements or elements[0][1][1:-1] != ["vertex"] or not COUNT_PATTERN.fullmatch(elements[0][1][-1]):
        read.errors.append("the first element must be declared as: element vertex NUMBER")
        return 0, []
    first, following = elements[0][0], elements[1][0] if len(elements) > 1 else len(words)
    properties = [(w[-1], " ".join(w[1:-1])) for w in words[first:following] if w[:1] == ["property"]]
    read.errors += list(_property_errors(dict(properties)))
    return int(elements[0][1][-1]), [name for name, _ in properties]


def _property_errors(kinds: dict[str, str]) -> Iterator[str]:
    """The errors in the properties of a vertex and their types."""
    for name, kind in kinds.items():
        if name in PROPERTIES and ALIASES.get(kind, kind) != PROPERTIES[name]:
            yield f"property {name} must have the type {PROPERTIES[name]}, not {kind}"
    for name in PLACE:
        if name not in kinds:
            yield f"property float {name} is missing"
    for group in (RGB, NORMAL):
        if 0 < len(set(group) & kinds.keys()) < len(group):
            yield f"of the properties {', '.join(group)}, either all or none must be present"


def _read_body(read: CloudFile, lines: list[bytes], count: int, names: list[str]) -> None:
    """Read the vertices into the columns, or note an error if the vertices are invalid."""
    rows = lines[:count]
    try:
        table = np.loadtxt(rows, ndmin=2, comments=None) if any(map(bytes.strip, rows)) else np.zeros((0, len(names)))
    except ValueError as error:
        read.errors.append(f"each vertex must be a line of numbers: {error}")
        return
    if table.shape != (count, len(names)):
        declared = f"the header declares {count} vertices with {len(names)} numbers each"
        read.errors.append(f"{declared}, but the file has {len(table)} with {table.shape[1]}")
        return
    if not np.isfinite(table).all():
        read.errors.append("all numbers of the vertices must be finite")
        return
    read.columns = dict(zip(names, table.T, strict=True))
