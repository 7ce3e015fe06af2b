"""Reading a dataset's folder."""

from collections.abc import Iterator
from pathlib import Path

from pipeline.errors import InputError
from sarsim.dataset.manifest import FILE, Manifest, SceneEntry, sha256_of
from sarsim.dataset.scene_file import Scene


class Dataset:
    """Reads a dataset, scene by scene.

    Attributes:
        folder: folder of the dataset.
        entries: the scenes listed in ``dataset.json``, in order of their index.
        recipe, generator: the recipe of the scenes, and the program and version that made them.
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
        """Every scene, open until the next one; InputError if its file is missing, changed or broken."""
        for entry in self.entries:
            path = self.folder / entry.file
            # Check before HDF5 opens the file, because its library hangs on some damaged files.
            if entry.sha256 and path.is_file() and sha256_of(path) != entry.sha256:
                raise InputError(
                    f"{path}: its checksum differs from the one in {FILE};"
                    " to generate the scene again, run sarsim-dataset with the original flags"
                )
            with Scene(path) as scene:
                yield entry, scene
