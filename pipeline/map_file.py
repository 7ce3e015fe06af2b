"""The map of an episode as a file from which a later episode continues: the kept data of each keyframe as numbers."""

import zipfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.errors import InputError
from pipeline.files import load_arrays, whole_file
from pipeline.frame import Frame, Intrinsics
from pipeline.labels import Label
from pipeline.localisation.odometry import Keyframes
from pipeline.mapper import Mapper, Observation
from pipeline.metric_map.grid_kernels import is_rigid
from pipeline.metric_map.packed_depth import unpack_returns
from pipeline.robot import RobotModel
from pipeline.segments.members import Member
from pipeline.segments.plane import Moments
from pipeline.semantic_map.semantic_map import VOXEL
from pipeline.semantic_map.voxels import VoxelCloud
from pipeline.traversability.elevation_map import CELL, ElevationMap
from pipeline.traversability.ground_evidence import Assumed, Driven, GroundEvidence, Seen
from pipeline.victims.victim_map import Sighting, Victim

FORMAT, VERSION = "sarsim keyframes", 3
UNIT = 2.5e-4  # m, to which points are rounded
KINDS = Seen, Assumed, Driven  # of evidence of the ground, by number
LAYOUT: dict[str, tuple[str, *tuple[str | int, ...]]] = {
    "depth": ("u2", "K", "H", "W"),
    "camera": ("f8", "K", 4),  # fx, fy, cx, cy
    "T_base_camera": ("f8", "K", 4, 4),
    "T_map_base": ("f8", "K", 4, 4),
    "T_map_base_added": ("f8", "K", 4, 4),
    "ups": ("f8", "K", 3),
    "labelled": ("i8", "K"),  # number of points with shares; -1 if the keyframe was not labelled
    "shares": ("u1", "Q", len(Label)),
    "local_points": ("i4", "N", 3),
    "local_normals": ("i1", "N", 3),  # 1/127
    "local_owner": ("i8", "N"),
    "ground": ("i8", "G", 5),  # keyframe, kind, numbers of points: assumed, or a drive's track, obstacles, touched
    "ground_points": ("i4", "D", 3),
    "members": ("i8", "M", 5),  # keyframe, class, numbers of surfels, corners and points
    "planes": ("f8", "M", 15),  # normal, Σ x, Σ x xᵀ
    "outlines": ("i4", "O", 3),
    "member_points": ("i4", "L", 3),
    "victims": ("f8", "V", 6),  # missed, photo_shows, numbers of sightings and tried, height and width of the photo
    "tried": ("f8", "T", 3),
    "photos": ("u1", "B"),
    "sightings": ("f8", "S", 15),  # keyframe, number of points, confidence, camera, information
    "sighting_points": ("i4", "R", 3),
}
"""Type and shape of each entry of the file; a letter stands for the same length in every entry."""

Arrays = dict[str, NDArray[Any]]
Rows = dict[str, Any]


def save_keyframes(mapper: Mapper, path: Path) -> None:
    """Write all kept data of a mapper, laid out as ``LAYOUT``, as a compressed ``.npz``, whole or not at all.

    Raises:
        InputError: it cannot be written.
    """
    entries = _keyframes(mapper) | _ground(mapper) | _members(mapper) | _victims(mapper.victims.all)
    arrays = {name: _array(value, *LAYOUT[name]) for name, value in entries.items()}
    with whole_file(path) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        for name, array in {"format": np.array(FORMAT), "version": np.array(VERSION), **arrays}.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, array, allow_pickle=False)


def _array(value: ArrayLike, kind: str, *shape: str | int) -> NDArray[Any]:
    """An array of that type; also an empty one gets that number of columns."""
    array = np.asarray(value, kind)
    return array if array.size else np.zeros([n if isinstance(n, int) else 0 for n in shape], kind)


def load_keyframes(path: Path, mapper: Mapper) -> None:
    """Restore the map of an earlier mapper into a new one; the restored keyframes stay where they are.

    Raises:
        InputError: the file is missing, damaged, foreign or of another version; the mapper must not be used then.
    """
    with _opened(path) as e:
        observations, seen = zip(*_observations(e), strict=True)
        local = _unpacked(e["local_points"]), e["local_normals"] / 127, e["local_owner"]
        mapper.localisation.restore(Keyframes(e["T_map_base"], e["ups"], *local))
        mapper.segments.members = list(_restored_members(e))
        mapper.victims.all = list(_restored_victims(e))
        mapper.restore(list(observations), list(_evidence(e, seen)), e["T_map_base"], e["T_map_base_added"])


def load_elevation_map(path: Path, robot: RobotModel) -> tuple[ElevationMap, NDArray[np.float64]]:
    """Only the final elevation map, for a robot, and the (K, 4, 4) poses of the keyframes in ``map``.

    Raises:
        InputError: as :func:`load_keyframes`.
    """
    elevation_map = ElevationMap(robot)
    with _opened(path) as e, elevation_map.made_anew():
        _, seen = zip(*_observations(e), strict=True)
        for k, evidence in _evidence(e, seen):
            evidence.put(elevation_map, e["T_map_base"][k])
    return elevation_map, e["T_map_base"]


@contextmanager
def _opened(path: Path) -> Iterator[Arrays]:
    """The checked entries of a file; an error in the block that uses them also becomes InputError."""
    e = load_arrays(path, "map of an episode")
    if str(e.pop("format", "")) != FORMAT:
        raise InputError(f"{path}: not the map of an episode")
    if e.pop("version", np.array(0)).tolist() != VERSION:
        raise InputError(f"{path}: not of version {VERSION} of this format")
    try:
        _check(e)
        yield e
    except (ValueError, IndexError, KeyError, StopIteration, RuntimeError, np.linalg.LinAlgError) as error:
        raise InputError(f"{path}: a damaged map: {' '.join(str(error).split())}") from error


def _check(e: Arrays) -> None:
    """Raise ValueError if an entry is missing, has a wrong type or shape, or holds an impossible number."""
    sizes: dict[str, int] = {}
    for name, (kind, *shape) in LAYOUT.items():
        if name not in e or e[name].dtype != np.dtype(kind) or e[name].ndim != len(shape):
            raise ValueError(f"{name} is missing or of a wrong type")
        for n, size in zip(shape, e[name].shape, strict=True):
            if size != (n if isinstance(n, int) else sizes.setdefault(n, size)):
                raise ValueError(f"{name} has the wrong shape {e[name].shape}")
        if not np.isfinite(e[name]).all():
            raise ValueError(f"{name} is not finite")
    for name in ("T_base_camera", "T_map_base", "T_map_base_added"):
        if not sizes["K"] or not all(map(is_rigid, e[name])):
            raise ValueError(f"{name} is not one rigid pose for each of {sizes['K']} keyframes")
    numbers = e["local_owner"], e["ground"][:, 0], e["members"][:, 0], e["sightings"][:, 0]
    if any(((n < 0) | (n >= sizes["K"])).any() for n in numbers) or (e["camera"][:, :2] <= 0).any():
        raise ValueError("something belongs to a keyframe that is not there, or a camera has no focal length")
    if not np.isin(e["members"][:, 1], list(Label)).all() or (e["members"][:, 2] <= 0).any():
        raise ValueError("a segment is of no class, or has no surfels")
    lengths = e["labelled"] + 1, e["ground"][:, 2:], e["members"][:, 3:], e["victims"][:, 2:], e["sightings"][:, 1]
    if any((n < 0).any() for n in lengths):
        raise ValueError("a length is negative")


def _keyframes(mapper: Mapper) -> Rows:
    kept, known = mapper.observations, mapper.localisation.keyframes()
    shares = [np.zeros((0, len(Label))) if o.probabilities is None else o.probabilities for o in kept]
    return {
        "depth": np.array([o.depth for o in kept]),
        "camera": np.array([(o.intrinsics.fx, o.intrinsics.fy, o.intrinsics.cx, o.intrinsics.cy) for o in kept]),
        "T_base_camera": np.array([o.T_base_camera for o in kept]),
        "T_map_base": known.poses,
        "T_map_base_added": mapper.poses_added,
        "ups": known.ups,
        "labelled": np.array([-1 if o.probabilities is None else len(o.probabilities) for o in kept]),
        "shares": np.concatenate(shares),
        "local_points": _packed([known.points]),
        "local_normals": np.rint(known.normals * 127),
        "local_owner": known.owner,
    }


def _observations(e: Arrays) -> Iterator[tuple[Observation, Seen]]:
    """The kept data of each keyframe, thinned and searched for dropouts as when it was added."""
    _, height, width = e["depth"].shape
    shares = _parts(e["shares"], e["labelled"].clip(0))
    for depth, camera, T, labelled in zip(e["depth"], e["camera"], e["T_base_camera"], e["labelled"], strict=True):
        intrinsics, probabilities = Intrinsics(width, height, *camera.tolist()), next(shares)
        frame = Frame(0.0, np.zeros((0, 0, 3), np.uint8), unpack_returns(depth), intrinsics, T, np.eye(4))
        cloud = VoxelCloud.of(frame.points(T), CELL / 2 if labelled < 0 else VOXEL)
        if labelled not in (-1, len(cloud.points)):
            raise ValueError(f"a keyframe has shares of {labelled} points, not of {len(cloud.points)}")
        yield (
            Observation(depth, intrinsics, T, cloud.points, cloud.hits, None if labelled < 0 else probabilities),
            Seen.of(frame, cloud),
        )


def _ground(mapper: Mapper) -> Rows:
    rows, points = [], list[NDArray[np.float32]]()
    for keyframe, evidence in mapper.ground:
        parts = () if isinstance(evidence, Seen) else tuple(vars(evidence).values())
        rows.append([keyframe, KINDS.index(type(evidence)), *map(len, parts), *[0] * (3 - len(parts))])
        points += parts
    return {"ground": rows, "ground_points": _packed(points)}


def _evidence(e: Arrays, seen: Sequence[Seen]) -> Iterator[tuple[int, GroundEvidence]]:
    """The evidence of the ground with its keyframes, in the order in which it was added."""
    points = _parts(_unpacked(e["ground_points"]), e["ground"][:, 2:].ravel())
    for keyframe, kind, *_ in e["ground"].tolist():
        parts = next(points), next(points), next(points)
        if KINDS[kind] is Seen:
            yield keyframe, seen[keyframe]
        else:
            yield keyframe, Assumed(parts[0]) if KINDS[kind] is Assumed else Driven(*parts)


def _members(mapper: Mapper) -> Rows:
    members = mapper.segments.members
    return {
        "members": [(m.keyframe, m.label, m.moments.count, len(m.outline), len(m.points)) for m in members],
        "planes": [[*m.normal, *m.moments.total, *m.moments.squares.ravel()] for m in members],
        "outlines": _packed(m.outline for m in members),
        "member_points": _packed(m.points for m in members),
    }


def _restored_members(e: Arrays) -> Iterator[Member]:
    outlines = _parts(_unpacked(e["outlines"]), e["members"][:, 3])
    points = _parts(_unpacked(e["member_points"]), e["members"][:, 4])
    for row, plane, outline, at in zip(e["members"].tolist(), e["planes"], outlines, points, strict=True):
        moments = Moments(row[2], plane[3:6], plane[6:].reshape(3, 3))
        yield Member(row[0], Label(row[1]), plane[:3], moments, outline, at)


def _victims(victims: list[Victim]) -> Rows:
    seen = [(s, confidence) for v in victims for s, confidence in zip(v.sightings, v.confidences, strict=True)]
    return {
        "victims": [(v.missed, v.photo_shows, len(v.sightings), len(v.tried), *v.photo.shape[:2]) for v in victims],
        "tried": [place for v in victims for place in v.tried],
        "photos": np.concatenate([np.zeros(0, np.uint8), *(v.photo.ravel() for v in victims)]),
        "sightings": [(s.keyframe, len(s.points), c, *s.camera, *s.information.ravel()) for s, c in seen],
        "sighting_points": _packed(s.points for s, _ in seen),
    }


def _restored_victims(e: Arrays) -> Iterator[Victim]:
    """Victims with their sightings; points and the rest follow from these when the mapper rebuilds its maps."""
    found = e["victims"][:, 2:].astype(np.int64)
    points = _parts(_unpacked(e["sighting_points"]), e["sightings"][:, 1].astype(np.int64))
    sightings, tried = _parts(e["sightings"], found[:, 0]), _parts(e["tried"], found[:, 1])
    photos = _parts(e["photos"], 3 * found[:, 2] * found[:, 3])
    for row, rows, places, photo in zip(e["victims"], sightings, tried, photos, strict=True):
        seen = [Sighting(int(s[0]), next(points), s[6:].reshape(3, 3), s[3:6]) for s in rows]
        shape = *row[4:].astype(np.int64).tolist(), 3
        first, *_ = seen
        victim = Victim(first.points, first.information, [], rows[:, 2].tolist(), photo.reshape(shape), float(row[1]))
        victim.missed, victim.tried, victim.sightings = int(row[0]), list(places), seen
        yield victim


def _packed(parts: Iterable[NDArray[np.floating]]) -> NDArray[np.int32]:
    """(N, 3) points of all parts in units of ``UNIT``, as differences of successive points, which compress well."""
    points = np.rint(np.concatenate([np.zeros((1, 3)), *parts]) / UNIT)
    return np.asarray(points[1:] - points[:-1], np.int32)


def _unpacked(steps: NDArray[np.int32]) -> NDArray[np.float32]:
    return (np.cumsum(steps, axis=0, dtype=np.int64) * UNIT).astype(np.float32)


def _parts(array: NDArray[Any], lengths: NDArray[np.int64]) -> Iterator[NDArray[Any]]:
    """Successive parts of an array, of these lengths.

    Raises:
        ValueError: the lengths do not add up to that of the array.
    """
    if lengths.sum() != len(array):
        raise ValueError(f"{len(array)} rows are not the {lengths.sum()} that belong there")
    ends = np.cumsum(lengths).tolist()
    return (array[start:end] for start, end in zip(chain([0], ends), ends, strict=False))
