"""Files and flags of strangers, mutated at random: each ends in a result or in InputError, and writes nowhere else.

``SARSIM_MUTATIONS=1000 pytest tests/test_foreign_files.py`` tries more than the suite does.
"""

import copy
import json
import os
import resource
import signal
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from pipeline import files
from pipeline.errors import InputError
from pipeline.files import load_arrays
from pipeline.semantic_map.networks.blocks import BlockConfig
from pipeline.semantic_map.networks.classifier import load_classifier, save_classifier
from pipeline.victims.detection.detector import VictimDetector
from pipeline.victims.detection.weights import write_weights
from sarsim.arenas.load import load_arena
from sarsim.dataset.exports.export import Export
from sarsim.dataset.exports.s3dis import S3dis
from sarsim.dataset.exports.tum import Tum
from sarsim.dataset.exports.yolo import Yolo
from sarsim.dataset.manifest import sha256_of
from sarsim.ground_truth.true_surface import Survey
from sarsim.scripts.settings import load_settings, settings_from
from sarsim.settings import EpisodeConfig
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
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
SECONDS, BYTES = 30, 4_000_000_000
"""of processor time and memory that one file may take."""
ROOT = Path(__file__).parents[1]


@pytest.fixture(autouse=True)
def limits(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let what takes too much memory or time fail."""
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + BYTES, before[1]))
    handler = signal.signal(signal.SIGPROF, lambda *_: pytest.fail(f"takes more than {SECONDS} s"))
    yield
    signal.signal(signal.SIGPROF, handler)
    resource.setrlimit(resource.RLIMIT_AS, before)


def draws(times: int = 1) -> Iterator[np.random.Generator]:
    for seed in range(times * COUNT):
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


def refused(action: Callable[[], object]) -> bool:
    """Whether it is refused in one line; anything but that or a result fails the test."""
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        action()
    except InputError as error:
        assert str(error).strip()
        return True
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return False


def with_odd_values(xml: str, rng: np.random.Generator) -> str:
    """One to three attributes changed or left out, or elements doubled."""
    root = ET.fromstring(xml)
    for _ in range(rng.integers(1, 4)):
        elements = [element for element in root.iter() if element.attrib]
        element = elements[rng.integers(len(elements))]
        name = list(element.attrib)[rng.integers(len(element.attrib))]
        odd, words = str(ODD[rng.integers(len(ODD))]), element.attrib[name].split() or [""]
        if rng.random() < 0.05:
            root.append(copy.deepcopy(element))
        elif rng.random() < 0.05:
            del element.attrib[name]
        elif rng.random() < 0.8:
            words[rng.integers(len(words))] = odd
            element.set(name, " ".join(words))
        else:
            element.set(name, f"{odd} " * int(rng.choice([1, 2, 1000])))
    return ET.tostring(root, encoding="unicode")


SMALL_ARENA = """<mujoco><compiler angle="degree"/>
<option timestep="0.005" gravity="0 0 -9.81" iterations="50" cone="elliptic"/><size nuser_geom="1" memory="10M"/>
<visual><map znear="0.02" zfar="30"/><quality shadowsize="1024"/><global offwidth="640"/></visual>
<statistic extent="6" center="0 0 0.5"/>
<default><default class="wall"><geom type="box" user="1" rgba="1 0 0 1"/></default></default>
<asset><texture name="t" type="2d" builtin="checker" width="64" height="64" rgb1="1 1 1" rgb2="0 0 0"/>
<material name="m" texture="t" texrepeat="4 4"/>
<mesh name="tetrahedron" vertex="0 0 0 0.3 0 0 0 0.3 0 0 0 0.3" scale="1 1 1"/>
<hfield name="h" nrow="3" ncol="3" size="0.3 0.3 0.1 0.05" elevation="0 0.1 0 0.2 0.3 0.2 0 0.1 0"/></asset>
<worldbody><light pos="0 0 3" dir="0 0 -1"/><site name="start" pos="-1 0 0" quat="1 0 0 0"/>
<geom type="plane" size="2 1.5 0.1" user="2" material="m" friction="1 0.005 0.0001"/>
<geom class="wall" pos="0 1.5 0.3" size="2 0.01 0.3"/><geom class="wall" pos="2 0 0.3" size="0.01 1.5 0.3"/>
<geom type="hfield" hfield="h" pos="1 0.8 0.05" user="7"/>
<geom type="mesh" mesh="tetrahedron" pos="1 -0.8 0" user="7"/>
<body pos="0.5 0.5 0.3"><freejoint/><geom type="sphere" size="0.1" mass="0.5" user="7"/></body>
<geom type="cylinder" size="0.03 0.1" pos="0 -1 0.1" euler="0 0 10" user="7"/></worldbody></mujoco>"""


HEIGHTS = 'nrow="3" ncol="3" size="0.3 0.3 0.1 0.05" elevation="0 0.1 0 0.2 0.3 0.2 0 0.1 0"'


def set_down(arena: Path) -> None:
    """What an episode begins with."""
    with closing(SimulatedRobot(load_arena(str(arena)), SimulationConfig(), 0)) as robot:
        survey = Survey(robot.physics.model.ptr, robot.physics.data.ptr, robot.base_body, robot.model)
        survey.surface_from(robot.trajectory[0].T_world_base[:3, 3])
        robot.sense()


def test_arenas_as_mjcf(tmp_path: Path) -> None:
    path, results = tmp_path / "arena.xml", []
    path.write_text(SMALL_ARENA)
    set_down(path)
    for rng in draws(2):
        path.write_text(with_odd_values(SMALL_ARENA, rng))
        results.append(refused(lambda: set_down(path)))
    assert any(results) and not all(results)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('pos="1 0.8', 'pos="nan 0.8', "geom_pos"),
        ('"0.005" g', '"nan" g', "timestep"),
        ('"0.005" g', '"0" g', "timestep"),
        ('iterations="50"', 'iterations="2000000000"', "iterations"),
        (HEIGHTS, 'nrow="40000" ncol="40000" size="0.3 0.3 0.1 0.05"', "more than 1 GB"),
        (HEIGHTS, 'nrow="5000" ncol="5000" size="0.3 0.3 0.1 0.05"', "cells 2.5e.07 is not between"),
        ('shadowsize="1024"', 'numslices="100000"', "numslices"),
        ('extent="6"', 'extent="1e-300"', "extent"),
        ('scale="1 1 1"', 'scale="1e20 1e20 1e20"', "geom_pos"),
        ('nuser_geom="1"', 'nuser_geom="2000000000"', "arena.xml: "),
        ('nuser_geom="1"', 'nuser_geom="1000"', "nuser_geom"),
        ('znear="0.02"', 'znear="nan"', "znear"),
        ('width="64" height="64"', 'width="60000" height="60000"', "arena.xml: "),
        ('size="2 1.5 0.1"', 'size="150 150 0.1"', "300 × 300 m: at most 6000 m²"),
    ],
)
def test_a_number_that_makes_no_sense_in_mjcf_is_named(old: str, new: str, said: str, tmp_path: Path) -> None:
    assert old in SMALL_ARENA
    path = tmp_path / "arena.xml"
    path.write_text(SMALL_ARENA.replace(old, new))
    with pytest.raises(InputError, match=said):
        set_down(path)


def test_arenas_as_raf(tmp_path: Path) -> None:
    good, path, results = (ROOT / "docs" / "first.raf").read_text(), tmp_path / "arena.raf", []
    for rng in draws(2):
        path.write_bytes(
            with_flips(good.encode(), rng) if rng.random() < 0.3 else with_odd_values(good, rng).encode()
        )
        results.append(refused(lambda: load_arena(str(path))))
    assert any(results) and not all(results)


def test_arrays_that_expand_endlessly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "map.npz"
    np.savez_compressed(path, a=np.zeros(10**6))
    assert path.stat().st_size < 10_000
    assert load_arrays(path, "map").keys() == {"a"}
    monkeypatch.setattr(files, "MOST_MEMORY", 10**6)
    with pytest.raises(InputError, match="a map that takes 8 MB"):
        load_arrays(path, "map")


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
        scene.write_bytes(with_flips(content, rng) if is_scene else content)
        entry = about["scenes"][1]
        told = about | {"scenes": [about["scenes"][0], entry | {"sha256": sha256_of(scene)}]}  # forged, not damaged
        manifest.write_text(json.dumps(told if is_scene else mutated(about, rng)))
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
