"""What an export is."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from sarsim.dataset.folder import Dataset
from sarsim.dataset.manifest import SceneEntry
from sarsim.dataset.scene_file import Scene


@dataclass(frozen=True)
class Export:
    """The flags of an export are the fields of a subclass."""

    data: Path
    """Folder of a dataset."""
    out: Path
    """New folder for the export; it appears when it is whole."""

    def run(self) -> Iterator[SceneEntry]:
        """Do the work; yields after each scene.

        Raises:
            InputError: the dataset cannot be read, or the folder cannot be written.
        """
        dataset = Dataset(self.data)
        with whole_folder(self.out) as folder:
            for entry, scene in dataset:
                self.add(folder, entry, scene)
                yield entry
            self.finish(folder, dataset)

    def add(self, folder: Path, entry: SceneEntry, scene: Scene) -> None:
        """Export one scene."""
        raise NotImplementedError

    def finish(self, folder: Path, dataset: Dataset) -> None:
        """Write what concerns all scenes."""


def write_image(path: Path, image: NDArray, *options: int) -> None:
    """Write (H, W) or (H, W, 3) RGB in the format of the name; raises OSError where it cannot be written."""
    bgr = image[..., ::-1] if image.ndim == 3 else image
    _, data = cv2.imencode(path.suffix, np.ascontiguousarray(bgr), options)
    path.write_bytes(data.tobytes())


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Lend a new folder beside ``path``, which takes its place when the block ends without an error.

    Raises:
        InputError: there is something already, or it cannot be written.
    """
    if path.exists():
        raise InputError(f"{path}: already there")
    partial = path.with_name(path.name + ".part")
    try:
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        yield partial
        partial.rename(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
