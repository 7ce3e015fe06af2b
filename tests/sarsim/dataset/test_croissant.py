"""Croissant metadata, by the keys that its specification requires, and by mlcroissant where it is installed."""

import json
from pathlib import Path
from typing import Any

import pytest

from sarsim.dataset.croissant import CROISSANT
from sarsim.dataset.exports.export import Export
from sarsim.dataset.exports.images import Yolo
from sarsim.dataset.exports.points import S3dis
from sarsim.dataset.generate import generate
from sarsim.dataset.manifest import MANIFEST_FILE, sha256_of
from sarsim.dataset.recipe import Recipe
from sarsim.plugins.ros.mcap import Mcap
from tests.sarsim.dataset.small import InProcess

RECIPE = Recipe(seed=2, frames=2, width=96, height=72, arenas=("nist_6x4",), ideal=1, clear=0, dust=(0.2, 0.2))
REQUIRED = {
    *("@context", "@type", "conformsTo", "description"),
    *("license", "name", "creator", "distribution", "recordSet"),
}
"""Of a dataset that is not published yet."""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of one scene."""
    folder = tmp_path_factory.mktemp("data") / "data"
    generate(RECIPE, 1, folder, InProcess())
    return folder


def metadata(folder: Path) -> dict[str, Any]:
    """The metadata of a folder, of which all files are there with their checksums, and the sources of all fields."""
    content: dict[str, Any] = json.loads((folder / CROISSANT).read_text())
    assert content.keys() >= REQUIRED and content["@type"] == "sc:Dataset"
    for file in content["distribution"]:
        if file["@type"] == "cr:FileObject":
            assert sha256_of(folder / file["contentUrl"]) == file["sha256"]
        else:
            assert list(folder.glob(file["includes"]))
    names = {file["@id"] for file in content["distribution"]}
    fields = [field for records in content["recordSet"] for field in records["field"]]
    assert fields and {field["source"]["fileObject"]["@id"] for field in fields if "source" in field} <= names
    return content


def test_a_dataset_names_its_scenes(data: Path) -> None:
    content = metadata(data)
    assert [file["@id"] for file in content["distribution"]] == [MANIFEST_FILE, "scenes/00000.h5"]
    assert [records["@id"] for records in content["recordSet"]] == ["scenes", "labels"]


@pytest.mark.parametrize(("kind", "named"), [(S3dis, "files-txt"), (Yolo, "files-jpg"), (Mcap, "files-mcap")])
def test_an_export_names_its_files(kind: type[Export], named: str, data: Path, tmp_path: Path) -> None:
    export = kind(data, tmp_path / "out")
    assert len(list(export.run())) == 1
    content = metadata(export.out)
    assert content["name"] == "out"
    assert {file["@id"] for file in content["distribution"]} >= {"README.md", "labels.csv", "LICENSE", named}


def test_mlcroissant_reads_it(data: Path) -> None:
    mlcroissant = pytest.importorskip("mlcroissant")
    dataset = mlcroissant.Dataset(str(data / CROISSANT))
    assert not dataset.metadata.ctx.issues.errors
    (scene,) = dataset.records("scenes")
    assert scene["scenes/split"] == b"train"
