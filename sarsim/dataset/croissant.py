"""``croissant.json``: the description of a dataset or an export in Croissant 1.0, a JSON-LD format.

See https://docs.mlcommons.org/croissant/docs/croissant-spec.html; publishers add ``url`` and ``datePublished``.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from pipeline.files import atomic_write
from pipeline.labels import Label
from sarsim.dataset.manifest import MANIFEST_FILE, Manifest, sha256_of

CROISSANT = "croissant.json"
LICENSE_URL = "https://www.apache.org/licenses/LICENSE-2.0"
MEDIA_TYPES = {
    ".json": "application/json",
    ".csv": "text/csv",
    ".txt": "text/plain",
    ".yaml": "application/yaml",
    ".md": "text/markdown",
    ".h5": "application/x-hdf5",
    ".jpg": "image/jpeg",
    ".png": "image/png",
}
"""Media type of each file suffix; files with other suffixes are application/octet-stream."""
CROISSANT_TERMS = (
    "citeAs column conformsTo equivalentProperty extract field fileProperty fileObject fileSet format includes"
)
CROISSANT_TERMS += " isLiveDataset jsonPath key md5 parentField path recordSet references regex repeated replace"
CROISSANT_TERMS += " samplingRate separator source subField transform"
"""Terms that Croissant itself defines."""
CONTEXT: dict[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    **{term: f"cr:{term}" for term in CROISSANT_TERMS.split()},
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "dct": "http://purl.org/dc/terms/",
    "sc": "https://schema.org/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
}


def describe_dataset(folder: Path, manifest: Manifest) -> None:
    """Write ``croissant.json``, which lists a dataset's files, scenes and labels, into the dataset's folder.

    Raises:
        InputError: the file cannot be written.
    """
    scenes = [manifest.scenes[index] for index in sorted(manifest.scenes)]
    files = [
        _file(MANIFEST_FILE, sha256_of(folder / MANIFEST_FILE)),
        *(_file(scene.file, scene.sha256) for scene in scenes),
    ]
    columns = {"index": int, "file": str, "split": str, "frames": int, "arena": str, "lighting": str, "sha256": str}
    scene_records = _record_set(
        "scenes", columns, lambda column: _source(MANIFEST_FILE, {"jsonPath": f"$.scenes[*].{column}"})
    )
    # Inline, because readers treat all paths into one JSON file as columns of one table.
    label_records = _record_set("labels", {"id": int, "name": str}, lambda column: {}) | {
        "data": [{"labels/id": int(label), "labels/name": label.name.lower()} for label in Label]
    }
    description = f"Labelled RGB-D scenes of simulated rescue arenas, HDF5, made by {manifest.generator}."
    _write(folder, folder.name, description, manifest.generator, files, [scene_records, label_records])


def describe_export(folder: Path, name: str, layout: str, generator: str) -> None:
    """Write ``croissant.json``, which lists an otherwise complete export's files and labels, into its folder.

    Raises:
        InputError: the file cannot be written.
    """
    top = sorted(path for path in folder.iterdir() if path.is_file())
    below = sorted({path.suffix for path in folder.glob("*/**/*") if path.is_file()})
    files = [_file(path.name, sha256_of(path)) for path in top]
    sets = [_file_set(suffix) for suffix in below]
    columns = {"id": int, "name": str, "red": int, "green": int, "blue": int}
    description = f"{' '.join(layout.split())} Made by {generator}."
    records = _record_set("labels", columns, lambda column: _source("labels.csv", {"column": column}))
    _write(folder, name, description, generator, [*files, *sets], [records])


def _write(
    folder: Path,
    name: str,
    description: str,
    generator: str,
    files: Iterable[dict[str, Any]],
    records: Iterable[dict[str, Any]],
) -> None:
    content = {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": name,
        "description": description,
        "license": LICENSE_URL,
        "creator": {"@type": "sc:Organization", "name": generator},
        "version": "1.0.0",
        "distribution": list(files),
        "recordSet": list(records),
    }
    with atomic_write(folder / CROISSANT) as path:
        path.write_text(json.dumps(content, indent=1) + "\n")


def _file(path: str, sha256: str) -> dict[str, Any]:
    media = MEDIA_TYPES.get(Path(path).suffix, "application/octet-stream")
    about = {"@type": "cr:FileObject", "@id": path, "name": path, "contentUrl": path}
    return about | {"encodingFormat": media, "sha256": sha256}


def _file_set(suffix: str) -> dict[str, Any]:
    """The Croissant file set of all files with a suffix in subfolders."""
    media = MEDIA_TYPES.get(suffix, "application/octet-stream")
    name = f"files{suffix}".replace(".", "-")
    return {"@type": "cr:FileSet", "@id": name, "name": name, "encodingFormat": media, "includes": f"**/*{suffix}"}


def _record_set(name: str, columns: Mapping[str, type], source: Callable[[str], Mapping[str, Any]]) -> dict[str, Any]:
    """A record set with these columns; ``source`` returns the entries that locate a column's values."""
    kinds = {int: "sc:Integer", str: "sc:Text"}
    fields = [
        {"@type": "cr:Field", "@id": f"{name}/{column}", "name": column, "dataType": kinds[kind], **source(column)}
        for column, kind in columns.items()
    ]
    return {"@type": "cr:RecordSet", "@id": name, "name": name, "field": fields}


def _source(file: str, extract: Mapping[str, str]) -> dict[str, Any]:
    return {"source": {"fileObject": {"@id": file}, "extract": extract}}
