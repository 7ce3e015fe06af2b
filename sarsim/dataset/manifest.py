"""A dataset's folder and its ``dataset.json``, which lists the scenes and the checksums of their files."""

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from importlib.metadata import version
from pathlib import Path
from typing import Any, Self

from pipeline.errors import InputError
from pipeline.files import atomic_write, read_text
from pipeline.labels import COLOURS, Label
from sarsim.dataset.recipe import SPLIT_PERIOD, Recipe
from sarsim.dataset.scene_file import Scene

MANIFEST_FILE = "dataset.json"
SCENES_FOLDER = "scenes"
DATASET_FORMAT = "sarsim-dataset"
DATASET_VERSION = 1
SPLITS = ("train", "val", "test")
MAX_SCENES = 10**9
_REMEDY = "generate the dataset again in another folder"
_HELD_OUT = {4: "val", 9: "test"}
"""Split by the last digit of a scene's index (others: train), so that scenes keep their split as a dataset grows."""


@dataclass(frozen=True)
class SceneEntry:
    """One scene of a dataset.

    Attributes:
        index: number of the scene.
        file: path of the scene's file, relative to the dataset's folder.
        split: train, val or test.
        sha256: checksum of the file, in hexadecimal digits.
        frames: number of frames.
        arena: name or path of the arena.
        lighting: normal, dim or dark.
        points: number of depth returns of each label, by the label's name.
    """

    index: int
    file: str
    split: str
    sha256: str
    frames: int
    arena: str
    lighting: str
    points: dict[str, int]


@dataclass
class Manifest:
    """The content of ``dataset.json``.

    Attributes:
        recipe: the settings that determine every byte of the scenes, as JSON values.
        scenes: the complete scenes, by index.
        generator: program and version that made the scenes.
    """

    recipe: dict[str, Any]
    scenes: dict[int, SceneEntry]
    generator: str

    @classmethod
    def new(cls, recipe: Recipe) -> Self:
        """The manifest of a new dataset, without scenes."""
        settings = asdict(recipe)
        if not recipe.plugins:
            del settings["plugins"]
        return cls(json.loads(json.dumps(settings)), {}, f"sarsim {version('sarsim')}")

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read the manifest in a dataset's folder; InputError if there is no dataset of this version."""
        path = folder / MANIFEST_FILE
        if not path.exists():
            raise InputError(f"{folder}: not a dataset: {MANIFEST_FILE} is missing")
        try:
            content = json.loads(read_text(path))
        except InputError:
            raise
        except (ValueError, RecursionError) as error:
            raise InputError(f"{path}: not valid JSON: {error}; {_REMEDY}") from error
        if not isinstance(content, dict) or content.get("format") != DATASET_FORMAT:
            raise InputError(f"{path}: not the {MANIFEST_FILE} of a dataset: its format must be {DATASET_FORMAT!r}")
        if content.get("version") != DATASET_VERSION:
            raise InputError(
                f"{path}: has format version {content.get('version')}; this version of sarsim reads only version"
                f" {DATASET_VERSION}"
            )
        try:
            entries = [_entry(row) for row in content["scenes"]]
            recipe = dict(**content["recipe"])
            return cls(recipe, {entry.index: entry for entry in entries}, str(content["generator"]))
        except (KeyError, TypeError, ValueError) as error:
            said = f"the key {error} is missing" if isinstance(error, KeyError) else str(error)
            raise InputError(f"{path}: damaged: {said}; {_REMEDY}") from error

    def write(self, folder: Path) -> None:
        """Write or replace the manifest in a dataset's folder; InputError if it cannot be written."""
        content = {
            "format": DATASET_FORMAT,
            "version": DATASET_VERSION,
            "generator": self.generator,
            "recipe": self.recipe,
            "sensor": {"name": "ASUS Xtion PRO LIVE", "depth_unit_m": 0.001},
            "labels": [
                {"id": int(label), "name": label.name.lower(), "colour": COLOURS[label].tolist()} for label in Label
            ],
            "scenes": [asdict(self.scenes[index]) for index in sorted(self.scenes)],
        }
        with atomic_write(folder / MANIFEST_FILE) as partial:
            partial.write_text(json.dumps(content, indent=1) + "\n")

    def check_same(self, other: "Manifest", folder: Path) -> None:
        """Raise InputError if the other manifest's scenes would differ from this manifest's."""
        if self.generator != other.generator:
            raise InputError(
                f"{folder}: contains a dataset made by {self.generator}, but you are running {other.generator};"
                " choose another folder"
            )
        for name in self.recipe | other.recipe:
            mine, theirs = self.recipe.get(name), other.recipe.get(name)
            if mine != theirs:
                raise InputError(
                    f"{folder}: contains a dataset with {name} = {_abbreviated_json(mine)}, "
                    f"not {_abbreviated_json(theirs)}; choose another folder"
                )


class Dataset:
    """Reads a dataset, scene by scene.

    Attributes:
        folder: folder of the dataset.
        entries: the scenes listed in ``dataset.json``, in order of their index.
        recipe, generator: as in :class:`Manifest`.
    """

    def __init__(self, folder: Path):
        """Read the manifest; InputError if the folder holds no dataset."""
        self.folder = folder
        manifest = Manifest.read(folder)
        self.recipe, self.generator = manifest.recipe, manifest.generator
        self.entries = [manifest.scenes[index] for index in sorted(manifest.scenes)]

    def __len__(self) -> int:
        return len(self.entries)

    def __iter__(self) -> Iterator[tuple[SceneEntry, Scene]]:
        """Yield each scene's entry, and the scene, which is open until the next is requested.

        Raises:
            InputError: a file is missing, changed or broken.
        """
        for entry in self.entries:
            path = self.folder / entry.file
            # Check before HDF5 opens the file, because its library hangs on some damaged files.
            if entry.sha256 and path.is_file() and sha256_of(path) != entry.sha256:
                raise InputError(
                    f"{path}: its checksum differs from the one in {MANIFEST_FILE};"
                    " to generate the scene again, run sarsim-dataset with the original flags"
                )
            with Scene(path) as scene:
                yield entry, scene


def _entry(row: dict[str, Any]) -> SceneEntry:
    """The entry of a scene in the file; ValueError if a field is invalid, because exports build paths from fields."""
    keys = [f.name for f in fields(SceneEntry)]
    if not isinstance(row, dict) or row.keys() != {*keys}:
        raise ValueError(f"each scene must have exactly the keys {', '.join(keys)}")
    entry = SceneEntry(**row)
    if not (type(entry.index) is int and 0 <= entry.index < MAX_SCENES):
        raise ValueError(
            f"the index of a scene must be an integer from 0 to {MAX_SCENES - 1}, not {entry.index!r:.40}"
        )
    if entry.file != scene_path(entry.index):
        raise ValueError(f"the file of scene {entry.index} must be {scene_path(entry.index)}, not {entry.file!r:.80}")
    if entry.split not in SPLITS:
        raise ValueError(
            f"the split of scene {entry.index} is {entry.split!r:.80}; it must be one of {', '.join(SPLITS)}"
        )
    for name, kind in (("sha256", str), ("arena", str), ("lighting", str), ("frames", int), ("points", dict)):
        if not isinstance(getattr(entry, name), kind):
            raise ValueError(
                f"{name} of scene {entry.index} must be of type {kind.__name__}, not {getattr(entry, name)!r:.80}"
            )
    if not all(isinstance(count, int) for count in entry.points.values()):
        raise ValueError(f"points of scene {entry.index} must be integers")
    return entry


def scene_path(index: int) -> str:
    """Path of a scene's file, relative to the dataset's folder."""
    return f"{SCENES_FOLDER}/{index:05d}.h5"


def split_of(index: int) -> str:
    """Split of a scene: train, val or test, in the ratio 8 : 1 : 1."""
    return _HELD_OUT.get(index % SPLIT_PERIOD, "train")


def sha256_of(path: Path) -> str:
    """SHA-256 of a file's bytes, in hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _abbreviated_json(value: Any) -> str:
    return json.dumps(value).replace('"', "")[:200]
