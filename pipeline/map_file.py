"""The map of a run as a file from which a later run can continue: the observations of its keyframes."""

import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Poses
from pipeline.elevation_map.config import ElevationConfig
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.ground_evidence import Assumed, Driven, GroundEvidence
from pipeline.errors import InputError
from pipeline.files import atomic_write, load_results, run_all
from pipeline.frame import Intrinsics
from pipeline.geometry.planes import Moments
from pipeline.keyframes import Keyframes, Places, Seen
from pipeline.labels import Label
from pipeline.localisation.localisation import OdometryErrors, SavedKeyframes
from pipeline.mapper import Mapper
from pipeline.metric_map.io.npz import save_metric_map
from pipeline.robot import RobotModel
from pipeline.segments.segment import Member
from pipeline.semantic_map.class_shares import ClassShares
from pipeline.tracks.find import VICTIM, Reading, is_find_kind
from pipeline.tracks.track import Observation, Track, TrackPolicy
from pipeline.transforms import POSE, are_poses
from pipeline.victims.people import middle

KEYFRAMES = "keyframes.npz"  # The file in a results folder that ``--map`` reads
FORMAT, VERSION = "sarsim keyframes", 7

Row = dict[str, Any]
Arrays = dict[str, NDArray[Any]]
MANY = "*"
"""First dimension of a field whose number of entries differs from row to row."""


class Field(NamedTuple):
    """Type and shape of a field; a letter other than ``MANY`` stands for a length that all rows share."""

    kind: str
    shape: tuple[int | str, ...] = ()


def _points(kind: str = "f4") -> Field:
    return Field(kind, (MANY, 3))


LAYOUT: dict[str, dict[str, Field]] = {
    "keyframe": {
        "depth": Field("u2", ("H", "W")),
        "camera": Field("f8", (4,)),  # fx, fy, cx, cy
        "T_base_camera": Field("f8", (4, 4)),
        "T_map_base": Field("f8", (4, 4)),
        "up": Field("f8", (3,)),
        "points": _points("i2"),
        "hits": Field("u1", (MANY,)),
        "above": Field("u1", (MANY,)),
        "dropouts": _points("i2"),
        "dropout_hits": Field("u1", (MANY,)),
        "rays": _points("i2"),
        "is_labelled": Field("?"),
        "classes": Field("u1", (MANY, 2)),
        "share": Field("u1", (MANY,)),
        "surfaces": _points(),  # Points and normals with which frames are registered
        "normals": _points(),
        "order": Field("i8"),  # Position among all evidence about the ground
    },
    "odometry": {"errors": Field("f8", (5,)), "covariance": Field("f8", (5, 5))},  # a single row
    "assumed": {"keyframe": Field("i8"), "order": Field("i8"), "points": _points()},
    "driven": {
        "keyframe": Field("i8"),
        "order": Field("i8"),
        "track": _points(),
        "yaws": Field("f4", (MANY,)),
        "obstacles": _points(),
        "touched": _points(),
    },
    "member": {
        "keyframe": Field("i8"),
        "label": Field("i8"),
        "normal": Field("f8", (3,)),
        "count": Field("i8"),
        "total": Field("f8", (3,)),  # Σ x
        "squares": Field("f8", (3, 3)),  # Σ x xᵀ
        "outline": _points(),
        "points": _points(),
    },
    "victim": {
        "missed": Field("i8"),
        "photo_shows": Field("f8"),  # Number of the person's voxels times the confidence
        "photo": Field("u1", (MANY,)),
        "photo_shape": Field("i8", (3,)),
        "tried_from": Field("i8", (MANY,)),  # Keyframes, and positions relative to them
        "tried": _points("f8"),
        "sightings": Field("i8"),  # How many of the following ``sighting`` rows belong to this victim
    },
    "sighting": {
        "keyframe": Field("i8"),
        "confidence": Field("f8"),
        "camera": Field("f8", (3,)),
        "information": Field("f8", (3, 3)),
        "points": _points(),
    },
    "find": {
        "kind": Field("u1", (MANY,)),  # UTF-8
        "missed": Field("i8"),
        "tried_from": Field("i8", (MANY,)),
        "tried": _points("f8"),
        "sightings": Field("i8"),  # As in ``victim``, of the ``find_sighting`` rows
    },
    "find_sighting": {
        "keyframe": Field("i8"),
        "text": Field("u1", (MANY,)),  # UTF-8
        "confidence": Field("f8"),
        "corners": Field("f4", (MANY, 2)),
        "position": Field("f8", (3,)),
        "information": Field("f8", (3, 3)),
        "camera": Field("f8", (3,)),
        "has_depth": Field("?"),
        "points": _points(),
        "photo": Field("u1", (MANY,)),
        "photo_shape": Field("i8", (3,)),
    },
}
"""The rows of each kind. A field whose length varies is stored concatenated, with an array of its lengths."""


def save_maps(mapper: Mapper, folder: Path) -> None:
    """Write all maps into a folder, each independently; InputError, at the end, if one could not be written."""
    run_all(
        lambda: save_keyframes(mapper, folder / KEYFRAMES),
        lambda: save_metric_map(mapper.metric_map, folder / "metric_map.npz"),
        lambda: mapper.semantic_map.save(folder / "semantic_map.ply"),
        lambda: mapper.topological_map.save(folder / "topology.json"),
    )


def save_keyframes(mapper: Mapper, path: Path) -> None:
    """Write all stored data of a mapper in the layout ``LAYOUT`` to a compressed ``.npz``, completely or not at all.

    Raises:
        InputError: the file cannot be written.
    """
    people, finds = mapper.victims.all, mapper.finds.all
    rows = {
        "keyframe": list(_keyframe_rows(mapper)),
        "odometry": [vars(mapper.localisation.keyframes().odometry)],
        "assumed": list(_ground_rows(mapper.keyframes, Assumed)),
        "driven": list(_ground_rows(mapper.keyframes, Driven)),
        "member": [_member_row(member) for member in mapper.segments.members],
        "victim": [_track_row(track) for track in people],
        "sighting": [_observation_row(seen) for track in people for seen in track.seen],
        "find": [_track_row(track) for track in finds],
        "find_sighting": [_observation_row(seen) for track in finds for seen in track.seen],
    }
    arrays = {"format": np.array(FORMAT), "version": np.array(VERSION)}
    for kind, fields in LAYOUT.items():
        for name, field in fields.items():
            arrays |= _columns(f"{kind}.{name}", field, [row[name] for row in rows[kind]])
    with atomic_write(path) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        for name, array in arrays.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, array, allow_pickle=False)


def _columns(name: str, field: Field, values: Sequence[Any]) -> Arrays:
    """The arrays of a field: the values of all rows, and their lengths if these vary."""
    rows = [np.asarray(value, field.kind) for value in values]
    fixed = [n if isinstance(n, int) else 0 for n in field.shape]
    if field.shape[:1] == (MANY,):
        nothing = np.zeros([0, *fixed[1:]], field.kind)
        return {name: np.concatenate([nothing, *rows]), f"{name}.lengths": np.array([*map(len, rows)], np.int64)}
    return {name: np.stack(rows) if rows else np.zeros([0, *fixed], field.kind)}


def load_keyframes(path: Path, mapper: Mapper) -> None:
    """Restore the map of an earlier run into a new mapper; the restored keyframes keep their poses.

    Raises:
        InputError: the file is missing, damaged, of another kind or version. The mapper must not be used afterwards.
    """
    with _opened(path) as rows:
        keyframes = rows["keyframe"]
        owner = np.repeat(np.arange(len(keyframes)), [len(row["surfaces"]) for row in keyframes])
        surfaces, normals = (np.concatenate([row[name] for row in keyframes]) for name in ("surfaces", "normals"))
        poses, ups = (np.array([row[name] for row in keyframes]) for name in ("T_map_base", "up"))
        odometry = OdometryErrors(**rows["odometry"][0])
        mapper.localisation.restore(SavedKeyframes(poses, ups, surfaces, normals, owner, odometry))
        _restore_keyframes(rows, mapper.keyframes)
        mapper.segments.members = [_member_of(row) for row in rows["member"]]
        seen, of_find = iter(rows["sighting"]), iter(rows["find_sighting"])
        mapper.victims.all = [_person_of(row, _next(row, seen), mapper.victims.policy) for row in rows["victim"]]
        mapper.finds.all = [_find_of(row, _next(row, of_find), mapper.finds.policy_of) for row in rows["find"]]
        mapper.restore()


def read_keyframes(path: Path, robot: RobotModel, config: ElevationConfig = ElevationConfig()) -> Keyframes:
    """Only the keyframes of a map, with their evidence about the ground; InputError as in :func:`load_keyframes`."""
    keyframes = Keyframes(robot, reach=0.0, cell=config.cell, noticeable=0.0)
    with _opened(path) as rows:
        _restore_keyframes(rows, keyframes)
    return keyframes


def load_elevation_map(
    path: Path, robot: RobotModel, config: ElevationConfig = ElevationConfig()
) -> tuple[ElevationMap, Poses]:
    """Only the final elevation map for a robot, and the poses of the keyframes in ``map``.

    Raises:
        InputError: as in :func:`load_keyframes`.
    """
    elevation_map, keyframes = ElevationMap(robot, config), read_keyframes(path, robot, config)
    with elevation_map.rebuilding(keyframes.boxes()):
        for k, evidence in keyframes.ground:
            evidence.put(elevation_map, keyframes.poses[k])
    return elevation_map, keyframes.poses


@contextmanager
def _opened(path: Path) -> Iterator[dict[str, list[Row]]]:
    """Yield the checked rows of a file, by kind; errors in the ``with`` block become InputError too."""
    arrays = load_results(path, "map saved by a run", KEYFRAMES, FORMAT, VERSION)
    try:
        sizes: dict[str, int] = {}
        rows = {kind: _rows(arrays, kind, fields, sizes) for kind, fields in LAYOUT.items()}
        _check(rows)
        yield rows
    except (ValueError, IndexError, KeyError, StopIteration, RuntimeError, np.linalg.LinAlgError) as error:
        said = " ".join(str(error).split())
        raise InputError(f"{path}: the map is invalid ({said}); repeat the run that wrote it") from error


def _rows(arrays: Arrays, kind: str, fields: dict[str, Field], sizes: dict[str, int]) -> list[Row]:
    """The rows of a kind; ValueError if an entry is missing, not finite, or of the wrong type or shape."""
    columns = [list(_values(arrays, f"{kind}.{name}", field, sizes)) for name, field in fields.items()]
    if len({len(column) for column in columns}) != 1:
        raise ValueError(f"the {kind} arrays have different lengths")
    return [dict(zip(fields, values, strict=True)) for values in zip(*columns, strict=True)]


def _values(arrays: Arrays, name: str, field: Field, sizes: dict[str, int]) -> Iterator[Any]:
    """The value of a field in each row."""
    array = arrays.get(name, np.zeros(0))
    has_lengths = field.shape[:1] == (MANY,)
    of_row = array.shape[1:]
    expected = field.shape[1:] if has_lengths else field.shape
    if array.dtype != np.dtype(field.kind) or len(of_row) != len(expected):
        raise ValueError(f"{name} is missing, or has the wrong type or number of dimensions")
    for n, size in zip(expected, of_row, strict=True):
        if size != (n if isinstance(n, int) else sizes.setdefault(n, size)):
            raise ValueError(f"{name} has the wrong shape {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} contains non-finite numbers")
    if not has_lengths:
        return iter(array if of_row else array.tolist())
    return _parts(name, array, arrays.get(f"{name}.lengths", np.zeros(0)))


def _parts(name: str, array: NDArray[Any], lengths: NDArray[Any]) -> Iterator[NDArray[Any]]:
    """Split an array into parts of the given lengths; ValueError if these do not add up to its length."""
    if lengths.dtype != np.int64 or lengths.ndim != 1 or (lengths < 0).any() or lengths.sum() != len(array):
        raise ValueError(f"{name} has {len(array)} entries, which do not match {name}.lengths")
    ends = np.cumsum(lengths).tolist()
    return (array[start:end] for start, end in zip(chain([0], ends), ends, strict=False))


def _check(rows: dict[str, list[Row]]) -> None:
    """Raise ValueError if a row holds an invalid number."""
    keyframes = len(rows["keyframe"])
    poses = [row[name] for row in rows["keyframe"] for name in ("T_base_camera", "T_map_base")]
    if not keyframes:
        raise ValueError("it has no keyframes")
    if not are_poses(poses):
        raise ValueError(f"the poses of each keyframe and its camera must be {POSE}")
    if len(rows["odometry"]) != 1 or np.linalg.eigvalsh(rows["odometry"][0]["covariance"])[0] <= 0:
        raise ValueError("it must have exactly one odometry covariance, which must be positive definite")
    of_keyframe = [row["keyframe"] for kind in LAYOUT for row in rows[kind] if "keyframe" in row]
    of_keyframe += [k for kind in ("victim", "find") for row in rows[kind] for k in row["tried_from"].tolist()]
    if not all(0 <= k < keyframes for k in of_keyframe):
        raise ValueError("an entry refers to a keyframe that does not exist")
    if any((row["camera"][:2] <= 0).any() for row in rows["keyframe"]):
        raise ValueError("a keyframe's focal lengths are not positive")
    classes = [row["label"] for row in rows["member"]]
    if not np.isin(classes, list(Label)).all() or any(
        (row["classes"] >= len(Label)).any() for row in rows["keyframe"]
    ):
        raise ValueError("a point or segment has an unknown class")
    if any(row["count"] < 1 for row in rows["member"]) or any(
        row["sightings"] < 1 for kind in ("victim", "find") for row in rows[kind]
    ):
        raise ValueError("a segment, victim or find has no sightings")
    if not all(is_find_kind(_text_of(row["kind"])) for row in rows["find"]):
        raise ValueError("a find is of an unknown kind")


def _keyframe_rows(mapper: Mapper) -> Iterator[Row]:
    keyframes, surfaces = mapper.keyframes, mapper.localisation.keyframes()
    order = {id(evidence): n for n, (_, evidence) in enumerate(keyframes.ground)}
    bounds = np.searchsorted(surfaces.owner, np.arange(len(keyframes) + 1))
    for k, seen in enumerate(keyframes.seen):
        camera, own = seen.intrinsics, slice(bounds[k], bounds[k + 1])
        shares = seen.shares or ClassShares(np.zeros((0, 2), np.uint8), np.zeros(0, np.uint8))
        yield {
            **vars(seen),
            "camera": (camera.fx, camera.fy, camera.cx, camera.cy),
            "T_map_base": surfaces.poses[k],  # As estimated; the pose in the maps may differ unnoticeably
            "up": surfaces.ups[k],
            "is_labelled": seen.shares is not None,
            **vars(shares),
            "surfaces": surfaces.points[own],
            "normals": surfaces.normals[own],
            "order": order[id(seen)],
        }


def _ground_rows(keyframes: Keyframes, kind: type) -> Iterator[Row]:
    for n, (k, evidence) in enumerate(keyframes.ground):
        if isinstance(evidence, kind):
            yield {"keyframe": k, "order": n, **vars(evidence)}


def _restore_keyframes(rows: dict[str, list[Row]], keyframes: Keyframes) -> None:
    """Add the keyframes of a file, and all evidence about the ground in the order in which it was found."""
    found: list[tuple[int, int, GroundEvidence]] = []
    for k, row in enumerate(rows["keyframe"]):
        keyframes.add(_seen_of(row), row["T_map_base"])
        found.append((row["order"], k, keyframes.seen[k]))
    found += [(row["order"], row["keyframe"], Assumed(row["points"])) for row in rows["assumed"]]
    parts = "track", "yaws", "obstacles", "touched"
    found += [(row["order"], row["keyframe"], Driven(*(row[part] for part in parts))) for row in rows["driven"]]
    for _, k, evidence in sorted(found, key=lambda entry: entry[0]):
        keyframes.add_ground(k, evidence)


def _seen_of(row: Row) -> Seen:
    height, width = row["depth"].shape
    if len({len(row[name]) for name in ("points", "hits", "above")}) > 1:
        raise ValueError("a keyframe has different numbers of points, hits and overhangs")
    if len(row["dropout_hits"]) != len(row["dropouts"]):
        raise ValueError("a keyframe has different numbers of dropouts and dropout hits")
    if row["is_labelled"] and not len(row["classes"]) == len(row["share"]) == len(row["points"]):
        raise ValueError("a keyframe has different numbers of points, classes and shares")
    names = "depth", "T_base_camera", "points", "hits", "above", "dropouts", "dropout_hits", "rays"
    kept = {name: row[name] for name in names}
    shares = ClassShares(row["classes"], row["share"]) if row["is_labelled"] else None
    return Seen(**kept, intrinsics=Intrinsics(width, height, *row["camera"].tolist()), shares=shares)


def _member_row(member: Member) -> Row:
    return vars(member) | {
        "count": member.moments.count,
        "total": member.moments.total,
        "squares": member.moments.squares,
    }


def _member_of(row: Row) -> Member:
    moments = Moments(row["count"], row["total"], row["squares"])
    return Member(row["keyframe"], Label(row["label"]), row["normal"], moments, row["outline"], row["points"])


def _text_of(data: NDArray[np.uint8]) -> str:
    return data.tobytes().decode()


def _data_of(text: str) -> NDArray[np.uint8]:
    return np.frombuffer(text.encode(errors="replace"), np.uint8)


def _track_row(track: Track) -> Row:
    tried, photo = Places.joined(track.tried), track.photo
    return {
        "kind": _data_of(track.policy.kind),
        "missed": track.missed,
        "photo_shows": track.policy.shows(track.seen[track.best]),
        "photo": photo.ravel(),
        "photo_shape": photo.shape,
        "tried_from": tried.keyframe,
        "tried": tried.position,
        "sightings": len(track.seen),
    }


def _observation_row(seen: Observation) -> Row:
    return vars(seen) | {
        "text": _data_of(seen.reading.text),
        "confidence": seen.reading.confidence,
        "corners": seen.reading.corners,
        "photo": seen.photo.ravel(),
        "photo_shape": seen.photo.shape,
    }


def _next(row: Row, observations: Iterator[Row]) -> list[Row]:
    """The rows of the observations of the next track."""
    return [next(observations) for _ in range(row["sightings"])]


def _track_of(row: Row, policy: TrackPolicy, seen: list[Observation]) -> Track:
    """A track; its observations are placed when the mapper builds its maps."""
    tried = [Places(k[None], at[None]) for k, at in zip(row["tried_from"], row["tried"], strict=True)]
    return Track(policy, seen, list(seen), missed=row["missed"], tried=tried)


def _person_of(row: Row, rows: list[Row], policy: TrackPolicy) -> Track:
    nothing, no_photo = np.zeros((0, 2), np.float32), np.zeros((0, 0, 3), np.uint8)
    seen = []
    for s in rows:
        reading, where = Reading(VICTIM, "", nothing, s["confidence"]), (middle(s["points"]), s["information"])
        seen.append(Observation(reading, s["keyframe"], *where, s["camera"], s["points"], no_photo))
    track = _track_of(row, policy, seen)
    track.seen[track.best] = replace(track.seen[track.best], photo=row["photo"].reshape(row["photo_shape"]))
    return track


def _find_of(row: Row, rows: list[Row], policy_of: Callable[[str], TrackPolicy]) -> Track:
    kind, seen = _text_of(row["kind"]), []
    for s in rows:
        reading = Reading(kind, _text_of(s["text"]), s["corners"], s["confidence"])
        where, photo = (s["position"], s["information"], s["camera"]), s["photo"].reshape(s["photo_shape"])
        seen.append(Observation(reading, s["keyframe"], *where, s["points"], photo, has_depth=s["has_depth"]))
    return _track_of(row, policy_of(kind), seen)
