"""The base classes of exports, and the files that every export has."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.resources import files
from inspect import cleandoc
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.files import check_folder
from pipeline.frame import Frame, Intrinsics
from pipeline.labels import COLOURS, Label
from sarsim.dataset.croissant import describe_export
from sarsim.dataset.manifest import Dataset, SceneEntry
from sarsim.dataset.scene_file import Scene
from sarsim.dataset.settings import check_range

TEMPLATES = files("sarsim.dataset") / "templates"
JPEG_QUALITY = 95  # 0 to 100


@dataclass(frozen=True)
class Export:
    """Base class of exports; the flags of ``sarsim-export-dataset`` set the fields of the same names."""

    data: Path
    """Folder of a dataset."""
    out: Path
    """New folder for the export; it appears once the export is complete."""

    def run(self) -> Iterator[SceneEntry]:
        """Make the export; yield each scene's entry once the scene is exported.

        Raises:
            InputError: the dataset cannot be read, or the folder cannot be written.
        """
        dataset = Dataset(self.data)
        cameras: dict[str, Intrinsics] = {}
        with atomic_folder(self.out) as folder:
            for entry, scene in dataset:
                cameras[room_name(entry)] = scene.intrinsics
                self.add(folder, entry, scene)
                yield entry
            layout, seed = cleandoc(str(type(self).__doc__)), dataset.recipe.get("seed")
            write_description(folder, folder.name, layout, cameras, len(dataset), dataset.generator, seed)
            self.finish(folder, dataset)
            describe_export(folder, folder.name, layout, dataset.generator)

    def add(self, folder: Path, entry: SceneEntry, scene: Scene) -> None:
        """Export one scene."""
        raise NotImplementedError

    def finish(self, folder: Path, dataset: Dataset) -> None:
        """Write the files that concern all scenes."""


@dataclass(frozen=True)
class ImageExport(Export):
    """Base class of exports with images/<split>/*.jpg and annotations of the objects in them."""

    min_area: int = 100
    """Minimum number of visible pixels for an object to get a box."""

    def __post_init__(self) -> None:
        check_range("min-area", self.min_area, 1)

    def write_images(self, folder: Path, entry: SceneEntry, scene: Scene) -> Iterator[tuple[str, Frame]]:
        """Write every frame's image, and yield the image's name without suffix, and the frame."""
        images = folder / "images" / entry.split
        images.mkdir(parents=True, exist_ok=True)
        for index, frame in enumerate(scene):
            name = f"{entry.index:05d}_{index:05d}"
            write_image(images / f"{name}.jpg", frame.rgb, cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY)
            yield name, frame


def room_name(entry: SceneEntry) -> str:
    """Name of the room or sequence that a scene becomes."""
    return f"arena_{entry.index}"


def label_names() -> str:
    """The labels' names in the order of their numbers, one per line."""
    return "".join(f"{label.name.lower()}\n" for label in Label)


def write_description(
    folder: Path,
    title: str,
    layout: str,
    cameras: Mapping[str, Intrinsics],
    scenes: int,
    generator: str,
    seed: object,
) -> None:
    """Write the files of every export: README.md (a Hugging Face card), labels.csv, LICENSE and intrinsics.json."""
    rows = [f"{int(label)},{label.name.lower()},{','.join(map(str, COLOURS[label].tolist()))}\n" for label in Label]
    (folder / "labels.csv").write_text("".join(["id,name,red,green,blue\n", *rows]))
    known = {name: asdict(camera) for name, camera in cameras.items()}
    (folder / "intrinsics.json").write_text(json.dumps(known, indent=1) + "\n")
    (folder / "LICENSE").write_text((TEMPLATES / "license.txt").read_text())
    size = "n<1K" if scenes < 1000 else "1K<n<10K"
    about = {"title": title, "name": json.dumps(title), "layout": layout, "size": size, "scenes": scenes}
    card = (TEMPLATES / "README.md").read_text()
    (folder / "README.md").write_text(card.format(**about, generator=generator, seed=seed))


def write_image(path: Path, image: NDArray, *options: int) -> None:
    """Write an (H, W) or (H, W, 3) RGB image in the format of the suffix; OSError if it cannot be written."""
    bgr = image[..., ::-1] if image.ndim == 3 else image
    _, data = cv2.imencode(path.suffix, np.ascontiguousarray(bgr), options)
    path.write_bytes(data.tobytes())


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Make a folder of the same name for the block to fill; if there is no error, its content appears in ``path``.

    Raises:
        InputError: ``path`` exists and is not an empty folder, or cannot be written.
    """
    check_folder(path, marks=())
    whole = path.resolve()  # "." has no name
    existed = whole.exists()
    try:
        whole.parent.mkdir(parents=True, exist_ok=True)
        place = whole if existed else whole.parent
        with TemporaryDirectory(dir=place, prefix=f"{whole.name}-", suffix=".part") as folder:
            partial = Path(folder, whole.name)
            partial.mkdir()
            yield partial
            if existed:  # It may be the current folder or a mount point, which cannot be replaced
                made = list(partial.iterdir())
                if taken := [file.name for file in made if (whole / file.name).exists()]:
                    raise InputError(f"{path}: contains {taken[0]}; choose a new or empty folder")
                for file in made:
                    file.rename(whole / file.name)
            else:
                partial.rename(whole)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from error
