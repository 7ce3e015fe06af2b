"""Files and flags of strangers, mutated at random: each ends in a result or in InputError, and writes nowhere else.

``SARSIM_MUTATIONS=1000 pytest tests/test_foreign_files.py`` tries more than the suite does.
"""

import json
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from pipeline.errors import InputError
from pipeline.semantic_map.networks.blocks import BlockConfig
from pipeline.semantic_map.networks.classifier import load_classifier, save_classifier
from pipeline.victims.detection.detector import VictimDetector
from pipeline.victims.detection.weights import write_weights
from sarsim.dataset.exports.export import Export
from sarsim.dataset.exports.s3dis import S3dis
from sarsim.dataset.exports.tum import Tum
from sarsim.dataset.exports.yolo import Yolo
from sarsim.scripts.settings import load_settings, settings_from
from sarsim.settings import EpisodeConfig
from tests.pipeline.semantic_map.networks.small_network import network
from tests.pipeline.victims.detection.networks import SMALL, random_network
from tests.sarsim.dataset.small import toys

COUNT = int(os.environ.get("SARSIM_MUTATIONS", "100"))
ODD = [
    0,
    -1,
    1,
    1e-9,
    1e300,
    2**31,
    2**63,
    10**30,
    float("nan"),
    float("inf"),
    "",
    "x",
    "../..",
    "/tmp/else",
    None,
    [],
    {},
]
"""What a number, a name or a list may become."""


def draws() -> Iterator[np.random.Generator]:
    for seed in range(COUNT):
        yield np.random.default_rng(seed)


def with_flips(content: bytes, rng: np.random.Generator) -> bytes:
    """Some bytes changed, or the end cut off."""
    data = bytearray(content)
    for place in rng.integers(len(data), size=rng.integers(1, 20)):
        data[place] = rng.integers(256)
    return bytes(data[: rng.integers(len(data))]) if rng.random() < 0.2 else bytes(data)


def mutated(value: object, rng: np.random.Generator) -> object:
    """A JSON value with one part replaced by something odd."""
    if isinstance(value, dict | list) and value and rng.random() < 0.9:
        keys = list(value) if isinstance(value, dict) else list(range(len(value)))
        key = keys[rng.integers(len(keys))]
        new = value.copy()
        new[key] = mutated(value[key], rng)
        return new
    return ODD[rng.integers(len(ODD))]


def refused(action) -> bool:
    """Whether it is refused in one line; anything but that or a result fails the test."""
    try:
        action()
    except InputError as error:
        assert str(error).strip()
        return True
    return False


def test_weights_of_a_point_network(tmp_path: Path) -> None:
    good, path = tmp_path / "good.safetensors", tmp_path / "w.safetensors"
    save_classifier(good, network(), BlockConfig(), {})
    tensors = load_file(good)
    with safe_open(good, framework="pt") as file:
        about = file.metadata()
    results = []
    for rng in draws():
        if rng.random() < 0.3:
            path.write_bytes(with_flips(good.read_bytes(), rng))
        else:
            odd = about | {("k", "blocks")[rng.integers(2)]: str(ODD[rng.integers(len(ODD))])}
            if rng.random() < 0.5:
                odd["blocks"] = json.dumps(mutated(json.loads(about["blocks"]), rng))
            save_file(tensors, path, odd)
        results.append(refused(lambda: load_classifier(path)))
    assert any(results)


def test_networks_of_darknet(tmp_path: Path) -> None:
    cfg, weights = tmp_path / "n.cfg", tmp_path / "n.weights"
    write_weights(weights, random_network(SMALL))
    content, results = weights.read_bytes(), []
    for rng in draws():
        lines = SMALL.strip().splitlines()
        at = rng.choice([k for k, line in enumerate(lines) if "=" in line])
        lines[at] = f"{lines[at].partition('=')[0]}={ODD[rng.integers(len(ODD))]}"
        if rng.random() < 0.3:
            lines[rng.integers(len(lines))] = lines[rng.integers(len(lines))]
        cfg.write_text("\n".join(lines))
        weights.write_bytes(with_flips(content, rng) if rng.random() < 0.3 else content)
        results.append(refused(lambda: VictimDetector.load(cfg, weights)))
    assert any(results)


@pytest.mark.parametrize("kind", [S3dis, Tum, Yolo])
def test_datasets(kind: type[Export], tmp_path: Path) -> None:
    toys(tmp_path / "in" / "data", 2)
    manifest, scene = (tmp_path / "in" / "data" / name for name in ("dataset.json", "scenes/00001.h5"))
    about, content, results = json.loads(manifest.read_text()), scene.read_bytes(), []
    before = {path.relative_to(tmp_path) for path in tmp_path.rglob("*")}
    for number, rng in enumerate(draws()):
        is_scene = rng.random() < 0.5
        manifest.write_text(json.dumps(about if is_scene else mutated(about, rng)))
        scene.write_bytes(with_flips(content, rng) if is_scene else content)
        export = kind(tmp_path / "in" / "data", tmp_path / f"out{number}")
        results.append(refused(lambda: list(export.run())))  # noqa: B023
    others = {
        path.relative_to(tmp_path)
        for path in tmp_path.rglob("*")
        if not path.relative_to(tmp_path).parts[0].startswith("out")
    }
    assert others == before and any(results)


def test_flags_and_settings(tmp_path: Path) -> None:
    words, path, results = (
        ["--arena", "--seed", "--steps", "--goals", "--dust", "--start", "--config", "-x", "--"],
        tmp_path / "c.yaml",
        [],
    )
    for rng in draws():
        line = [str([*words, *ODD][rng.integers(len(words) + len(ODD))]) for _ in range(rng.integers(1, 5))]
        results.append(refused(lambda: settings_from(EpisodeConfig, line)))  # noqa: B023
        path.write_text(
            json.dumps(mutated({"seed": 3, "goals": [[1, 2]], "random": {"columns": 3}, "out": "x"}, rng))
        )
        results.append(refused(lambda: load_settings(EpisodeConfig, path)))
    assert any(results)
