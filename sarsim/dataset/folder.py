"""A dataset's folder, to read."""

from collections.abc import Iterator
from pathlib import Path

from pipeline.errors import InputError
from sarsim.dataset.manifest import FILE, Manifest, SceneEntry, sha256_of
from sarsim.dataset.scene_file import Scene


class Dataset:
    """Reads a dataset, scene by scene.

    Attributes:
        folder: where it lies.
        entries: what ``dataset.json`` says of its scenes, by index.
        recipe, generator: what made them, and by what program.
    """

    def __init__(self, folder: Path):
        """Raises InputError where there is no dataset."""
        self.folder = folder
        manifest = Manifest.read(folder)
        self.recipe, self.generator = manifest.recipe, manifest.generator
        self.entries = [manifest.scenes[index] for index in sorted(manifest.scenes)]

    def __len__(self) -> int:
        return len(self.entries)

    def __iter__(self) -> Iterator[tuple[SceneEntry, Scene]]:
        """Every scene, open until the next one; InputError where its file is missing, changed or broken."""
        for entry in self.entries:
            path = self.folder / entry.file
            # Before HDF5 opens it: of some files that were damaged on the way its library never comes back.
            if entry.sha256 and path.is_file() and sha256_of(path) != entry.sha256:
                raise InputError(f"{path}: changed or damaged: its checksum is not the one in {FILE}")
            with Scene(path) as scene:
                yield entry, scene
