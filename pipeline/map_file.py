"""The map of a run as a file from which a later run can continue: the observations of its keyframes."""

import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Poses
from pipeline.elevation_map.config import ElevationConfig
from pipeline.elevation_map.elevation_map import ElevationMap
from pipeline.elevation_map.ground_evidence import AssumedGround, DrivenTrack, GroundEvidence
from pipeline.errors import InputError
from pipeline.files import atomic_write, load_results, run_all
from pipeline.frame import Intrinsics
from pipeline.geometry.planes import Moments
from pipeline.keyframes import AnchoredPlaces, KeyframeObservation, Keyframes
from pipeline.labels import Label
from pipeline.localisation.localisation import OdometryErrors, SavedKeyframes
from pipeline.mapper import Mapper
from pipeline.metric_map.io.npz import save_metric_map
from pipeline.robot import RobotModel
from pipeline.segments.segment import Member
from pipeline.semantic_map.top_two_classes import TopTwoClasses
from pipeline.tracks.find import VICTIM, Reading, is_find_kind
from pipeline.tracks.track import Observation, Track
from pipeline.transforms import POSE_REQUIREMENT, are_poses

KEYFRAMES = "keyframes.npz"  # The file in a results folder that ``--map`` reads
FORMAT, VERSION = "sarsim keyframes", 11

Row = dict[str, Any]
Field = tuple[str, *tuple[int | str, ...]]
"""Type and shape. A letter, which may only come first, stands for a length that differs from row to row; fields of a
row with the same letter have the same length."""
POINTS: Field = ("f4", "n", 3)
NOTHING = np.zeros(0)

LAYOUT: dict[str, dict[str, Field]] = {
    "keyframe": {
        "depth": ("u2", "p"),
        "depth_shape": ("i8", 2),  # Differs between cameras, and with the voxel size and range of the metric map
        "camera": ("f8", 4),  # fx, fy, cx, cy
        "T_base_camera": ("f8", 4, 4),
        "T_map_base": ("f8", 4, 4),
        "up": ("f8", 3),
        "points": ("i2", "n", 3),
        "hits": ("u1", "n"),
        "above": ("u1", "n"),
        "dropouts": ("i2", "d", 3),
        "dropout_hits": ("u1", "d"),
        "rays": ("i2", "r", 3),
        "is_labelled": ("?",),
        "classes": ("u1", "l", 2),
        "share": ("u1", "l"),
        "surfaces": ("f4", "s", 3),  # Points and normals with which frames are registered
        "normals": ("f4", "s", 3),
        "order": ("i8",),  # Position among all evidence about the ground
    },
    "odometry": {"errors": ("f8", 7), "covariance": ("f8", 7, 7)},  # A single row
    "assumed": {"keyframe": ("i8",), "order": ("i8",), "points": POINTS},
    "driven": {
        "keyframe": ("i8",),
        "order": ("i8",),
        "track": ("f4", "w", 3),
        "yaws": ("f4", "w"),
        "obstacles": ("f4", "o", 3),
        "touched": ("f4", "t", 3),
    },
    "member": {
        "keyframe": ("i8",),
        "label": ("i8",),
        "normal": ("f8", 3),
        "count": ("i8",),
        "total": ("f8", 3),  # Σ x
        "squares": ("f8", 3, 3),  # Σ x xᵀ
        "outline": ("f4", "o", 3),
        "points": POINTS,
    },
    "track": {  # Of people and finds
        "kind": ("u1", "k"),  # UTF-8
        "missed": ("i8", "m"),  # Keyframes
        "tried_from": ("i8", "t"),  # Keyframes, and positions relative to them
        "tried": ("f8", "t", 3),
        "observations": ("i8",),  # Number of the following ``observation`` rows that belong to it
    },
    "observation": {
        "keyframe": ("i8",),
        "text": ("u1", "k"),  # UTF-8
        "confidence": ("f8",),
        "corners": ("f4", "c", 2),
        "position": ("f8", 3),
        "information": ("f8", 3, 3),
        "camera": ("f8", 3),
        "has_depth": ("?",),
        "points": POINTS,
        "walls": ("f8", "w", 4),  # Planes
        "photo": ("u1", "p"),
        "photo_shape": ("i8", 3),
    },
}
"""The fields of the rows of each kind. A field whose length varies is stored concatenated, with an array of its
lengths."""
KEYFRAME_INDEX_FIELDS = "keyframe", "missed", "tried_from"
"""The fields that hold indices of keyframes."""


def varies(field: Field) -> bool:
    """Whether the length of a field differs from row to row."""
    return any(isinstance(size, str) for size in field[1:])


def save_maps(mapper: Mapper, folder: Path) -> None:
    """Write all maps into a folder; one failure does not prevent the others, but raises InputError at the end."""
    run_all(
        lambda: save_keyframes(mapper, folder / KEYFRAMES),
        lambda: save_metric_map(mapper.metric_map, folder / "metric_map.npz"),
        lambda: mapper.semantic_map.save(folder / "semantic_map.ply", mapper.metric_map.is_seen_through),
        lambda: mapper.topological_map.save(folder / "topology.json"),
    )


def save_keyframes(mapper: Mapper, path: Path) -> None:
    """Write all stored data of a mapper in the layout ``LAYOUT`` to a compressed ``.npz``, completely or not at all.

    Raises:
        InputError: the file cannot be written.
    """
    tracks = [*mapper.victims.all, *mapper.finds.all]
    rows = {
        "keyframe": list(_keyframe_rows(mapper)),
        "odometry": [vars(mapper.localisation.keyframes().odometry)],
        "assumed": list(_ground_rows(mapper.keyframes, AssumedGround)),
        "driven": list(_ground_rows(mapper.keyframes, DrivenTrack)),
        "member": [vars(member) | vars(member.moments) for member in mapper.segments.members],
        "track": [_track_row(track) for track in tracks],
        "observation": [_observation_row(seen) for track in tracks for seen in track.seen],
    }
    arrays = {"format": np.array(FORMAT), "version": np.array(VERSION)}
    for kind, layout in LAYOUT.items():
        for name, field in layout.items():
            dtype, *shape = field
            values = [np.asarray(row[name], dtype) for row in rows[kind]]
            nothing = np.zeros([n if isinstance(n, int) else 0 for n in shape], dtype)
            if varies(field):
                arrays[f"{kind}.{name}"] = np.concatenate([nothing, *values])
                arrays[f"{kind}.{name}.lengths"] = np.array([*map(len, values)], np.int64)
            else:
                arrays[f"{kind}.{name}"] = np.stack(values) if values else nothing[None][:0]
    with atomic_write(path) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        for name, array in arrays.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, array, allow_pickle=False)


def load_keyframes(path: Path, mapper: Mapper) -> None:
    """Restore the map of an earlier run into a new mapper; the restored keyframes keep their poses.

    Raises:
        InputError: the file is missing, damaged, of another kind or version, or without surfaces that the mapper's
            localisation needs. The mapper must not be used after this error.
    """
    with _checked_rows(path) as rows:
        keyframes = rows["keyframe"]
        owner = np.repeat(np.arange(len(keyframes)), [len(row["surfaces"]) for row in keyframes])
        surfaces, normals = (np.concatenate([row[name] for row in keyframes]) for name in ("surfaces", "normals"))
        poses, ups = (np.array([row[name] for row in keyframes]) for name in ("T_map_base", "up"))
        odometry = OdometryErrors(**rows["odometry"][0])
        mapper.localisation.restore(SavedKeyframes(poses, ups, surfaces, normals, owner, odometry))
        _restore_keyframes(rows, mapper.keyframes)
        for row in rows["member"]:
            moments = Moments(row["count"], row["total"], row["squares"])
            own = row["keyframe"], Label(row["label"]), row["normal"], moments, row["outline"], row["points"]
            mapper.segments.members.append(Member(*own))
        tracks = list(_tracks(rows, mapper))
        mapper.victims.all = [track for track in tracks if track.policy.kind == VICTIM]
        mapper.finds.all = [track for track in tracks if track.policy.kind != VICTIM]
        mapper.restore()


def read_keyframes(path: Path, robot: RobotModel, config: ElevationConfig = ElevationConfig()) -> Keyframes:
    """The keyframes of a map alone, with their evidence about the ground; for errors, see :func:`load_keyframes`."""
    keyframes = Keyframes(robot, reach=0.0, cell=config.cell, min_displacement=0.0)
    with _checked_rows(path) as rows:
        _restore_keyframes(rows, keyframes)
    return keyframes


def load_elevation_map(
    path: Path, robot: RobotModel, config: ElevationConfig = ElevationConfig()
) -> tuple[ElevationMap, Poses]:
    """The final elevation map alone, for a robot, and the poses of the keyframes in ``map``.

    Raises:
        InputError: see :func:`load_keyframes`.
    """
    elevation_map, keyframes = ElevationMap(robot, config), read_keyframes(path, robot, config)
    with elevation_map.rebuilding(keyframes.boxes()):
        for k, evidence in keyframes.ground_evidence:
            evidence.add_to_elevation_map(elevation_map, keyframes.poses[k])
    return elevation_map, keyframes.poses


@contextmanager
def _checked_rows(path: Path) -> Iterator[dict[str, list[Row]]]:
    """Yield the checked rows of a file, by kind; errors in the ``with`` block become InputError too."""
    arrays = load_results(path, "map saved by a run", KEYFRAMES, FORMAT, VERSION)
    try:
        rows = {kind: _rows(arrays, kind, layout) for kind, layout in LAYOUT.items()}
        _check(rows)
        yield rows
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except (ValueError, IndexError, KeyError, RuntimeError, np.linalg.LinAlgError) as error:
        said = " ".join(str(error).split())
        raise InputError(f"{path}: the map is invalid ({said}); repeat the run that wrote it") from error


def _rows(arrays: dict[str, NDArray[Any]], kind: str, layout: dict[str, Field]) -> list[Row]:
    """The rows of a kind; ValueError if an entry is missing, not finite, or of the wrong type or shape."""
    columns: dict[str, list[Any]] = {}
    sizes: dict[int | str, Any] = {}  # For each letter, the lengths of all rows
    for name, field in layout.items():
        dtype, *shape = field
        array = arrays.get(f"{kind}.{name}", NOTHING)
        if array.dtype != dtype or array.ndim != len(shape) + (not varies(field)):
            raise ValueError(f"{kind}.{name} is missing, or has the wrong type or number of dimensions")
        if not np.isfinite(array).all():
            raise ValueError(f"{kind}.{name} contains non-finite numbers")
        fits = array.shape[1:] == tuple(shape[varies(field) :])
        if varies(field):
            lengths = arrays.get(f"{kind}.{name}.lengths", NOTHING)
            fits &= lengths.dtype == np.int64 and lengths.ndim == 1 and bool((lengths >= 0).all())
            fits &= lengths.sum() == len(array) and np.array_equal(lengths, sizes.setdefault(shape[0], lengths))
        if not fits:
            raise ValueError(f"{kind}.{name} has a wrong shape or wrong lengths")
        if varies(field):
            columns[name] = [array[end - n : end] for n, end in zip(lengths, np.cumsum(lengths), strict=True)]
        else:
            columns[name] = list(array) if shape else array.tolist()
    if len({len(column) for column in columns.values()}) != 1:
        raise ValueError(f"the {kind} arrays have different lengths")
    return [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]


def _check(rows: dict[str, list[Row]]) -> None:
    """Raise ValueError if a row holds an invalid value."""

    def every(kind: str, name: str) -> list[Any]:
        return [row[name] for row in rows[kind]]

    keyframes, odometry = len(rows["keyframe"]), every("odometry", "covariance")
    if not keyframes:
        raise ValueError("it has no keyframes")
    if not are_poses([*every("keyframe", "T_base_camera"), *every("keyframe", "T_map_base")]):
        raise ValueError(f"the poses of each keyframe and its camera must be {POSE_REQUIREMENT}")
    if len(odometry) != 1 or np.linalg.eigvalsh(odometry[0])[0] <= 0:
        raise ValueError("it must have exactly one odometry covariance, which must be positive definite")
    columns = [(kind, name) for kind, layout in LAYOUT.items() for name in layout if name in KEYFRAME_INDEX_FIELDS]
    if not all(((np.asarray(k) >= 0) & (np.asarray(k) < keyframes)).all() for of in columns for k in every(*of)):
        raise ValueError("an entry refers to a keyframe that does not exist")
    if any((camera[:2] <= 0).any() for camera in every("keyframe", "camera")):
        raise ValueError("a keyframe's focal lengths are not positive")
    of_points = any((classes >= len(Label)).any() for classes in every("keyframe", "classes"))
    if of_points or not np.isin(every("member", "label"), list(Label)).all():
        raise ValueError("a point or segment has an unknown class")
    if not all(count > 0 for count in [*every("member", "count"), *every("track", "observations")]):
        raise ValueError("a segment, victim or find was never seen")
    if sum(every("track", "observations")) != len(rows["observation"]):
        raise ValueError("the observations of victims and finds do not add up")
    kinds = map(_text_of, every("track", "kind"))
    if not all(kind == VICTIM or is_find_kind(kind) for kind in kinds):
        raise ValueError("a find is of an unknown kind")


def _keyframe_rows(mapper: Mapper) -> Iterator[Row]:
    keyframes, surfaces = mapper.keyframes, mapper.localisation.keyframes()
    order = {id(evidence): n for n, (_, evidence) in enumerate(keyframes.ground_evidence)}
    bounds = np.searchsorted(surfaces.owner, np.arange(len(keyframes) + 1))
    for k, seen in enumerate(keyframes.observations):
        camera, own = seen.intrinsics, slice(bounds[k], bounds[k + 1])
        top_two_classes = seen.top_two_classes or TopTwoClasses(np.zeros((0, 2), np.uint8), np.zeros(0, np.uint8))
        yield {
            **vars(seen),
            "depth": seen.depth.ravel(),
            "depth_shape": seen.depth.shape,
            "camera": (camera.fx, camera.fy, camera.cx, camera.cy),
            "T_map_base": surfaces.poses[k],  # The estimated pose; the pose in the maps may differ unnoticeably
            "up": surfaces.ups[k],
            "is_labelled": seen.top_two_classes is not None,
            **vars(top_two_classes),
            "surfaces": surfaces.points[own],
            "normals": surfaces.normals[own],
            "order": order[id(seen)],
        }


def _ground_rows(keyframes: Keyframes, kind: type) -> Iterator[Row]:
    for n, (k, evidence) in enumerate(keyframes.ground_evidence):
        if isinstance(evidence, kind):
            yield {"keyframe": k, "order": n, **vars(evidence)}


def _restore_keyframes(rows: dict[str, list[Row]], keyframes: Keyframes) -> None:
    """Add the keyframes of a file, and all evidence about the ground in the order in which it was found."""
    found: list[tuple[int, int, GroundEvidence]] = []
    for k, row in enumerate(rows["keyframe"]):
        if row["is_labelled"] and len(row["classes"]) != len(row["points"]):
            raise ValueError("a keyframe has different numbers of points and classes")
        depth = row["depth"].reshape(row["depth_shape"])
        height, width = depth.shape
        top_two_classes = TopTwoClasses(row["classes"], row["share"]) if row["is_labelled"] else None
        seen = KeyframeObservation(
            **_fields_of(KeyframeObservation, row | {"depth": depth}),
            intrinsics=Intrinsics(width, height, *row["camera"].tolist()),
            top_two_classes=top_two_classes,
        )
        keyframes.add(seen, row["T_map_base"])
        found.append((row["order"], k, seen))
    for row in rows["assumed"]:
        found.append((row["order"], row["keyframe"], AssumedGround(**_fields_of(AssumedGround, row))))
    for row in rows["driven"]:
        found.append((row["order"], row["keyframe"], DrivenTrack(**_fields_of(DrivenTrack, row))))
    for _, k, evidence in sorted(found, key=lambda entry: entry[0]):
        keyframes.add_ground(k, evidence)


def _text_of(data: NDArray[np.uint8]) -> str:
    return data.tobytes().decode()


def _data_of(text: str) -> NDArray[np.uint8]:
    return np.frombuffer(text.encode(errors="replace"), np.uint8)


def _track_row(track: Track) -> Row:
    tried = AnchoredPlaces.joined(track.tried)
    return {
        "kind": _data_of(track.policy.kind),
        "missed": sorted(track.missed),
        "tried_from": tried.keyframe,
        "tried": tried.position,
        "observations": len(track.seen),
    }


def _observation_row(seen: Observation) -> Row:
    reading, photo = vars(seen.reading), {"photo": seen.photo.ravel(), "photo_shape": seen.photo.shape}
    return vars(seen) | reading | {"text": _data_of(seen.reading.text)} | photo


def _tracks(rows: dict[str, list[Row]], mapper: Mapper) -> Iterator[Track]:
    """Tracks of people and finds; their observations are placed when the mapper builds its maps."""
    left = iter(rows["observation"])
    for row in rows["track"]:
        kind = _text_of(row["kind"])
        seen = [_observation_of(kind, one) for one in islice(left, row["observations"])]
        tried = [AnchoredPlaces(k[None], at[None]) for k, at in zip(row["tried_from"], row["tried"], strict=True)]
        policy = mapper.victims.policy if kind == VICTIM else mapper.finds.policy_of(kind)
        yield Track(policy, seen, list(seen), missed=set(row["missed"].tolist()), tried=tried)


def _observation_of(kind: str, row: Row) -> Observation:
    reading = Reading(kind, _text_of(row["text"]), row["corners"], row["confidence"])
    photo = row["photo"].reshape(row["photo_shape"])
    return Observation(**_fields_of(Observation, row) | {"reading": reading, "photo": photo})


def _fields_of(kind: type, row: Row) -> Row:
    """The entries of a row that are fields of a dataclass."""
    return {field.name: row[field.name] for field in fields(kind) if field.name in row}
