"""What strangers bring, mutated at random: it ends in a result or in one line, and writes nowhere else.

``SARSIM_MUTATIONS=2000 pytest tests/test_foreign_files.py`` tries more than the suite, as ``make endurance`` does.
"""

import copy
import json
import os
import resource
import signal
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from itertools import chain
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from pipeline import files
from pipeline.datasets.replay import Replay, localisation_of
from pipeline.datasets.tum_folder import read_tum_folder
from pipeline.errors import InputError
from pipeline.explorer import Explorer
from pipeline.files import load_arrays, run_all
from pipeline.frame import Frame
from pipeline.localisation.localisation import LostError
from pipeline.localisation.slam import Slam
from pipeline.map_file import save_maps
from pipeline.mapper import Mapper
from pipeline.robot import Motion, Velocity
from pipeline.semantic_map.classifier import TruthClassifier
from pipeline.semantic_map.networks.blocks import BlockConfig
from pipeline.semantic_map.networks.classifier import load_classifier, save_classifier
from pipeline.semantic_map.rules import RuleClassifier
from pipeline.transforms import from_yaw
from pipeline.victims.detector import VictimDetector
from sarsim.arenas.load import load_arena
from sarsim.commands.settings import load_settings, settings_from
from sarsim.dataset.exports.export import Export
from sarsim.dataset.exports.images import Yolo
from sarsim.dataset.exports.points import S3dis
from sarsim.dataset.exports.tum import Tum
from sarsim.dataset.manifest import sha256_of
from sarsim.episode import Episode
from sarsim.ground_truth.true_surface import Survey
from sarsim.robots.names import robot_file
from sarsim.settings import EpisodeConfig
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from tests.pipeline.datasets.recorded_room import ODOMETRY, WAY, camera_poses, write_tum_folder
from tests.pipeline.kinematic_robot import KinematicRobot
from tests.pipeline.polygon_scene import floor, look, pose, wall
from tests.pipeline.robot_model import PIONEER
from tests.pipeline.semantic_map.networks.small_network import network
from tests.pipeline.victims.networks import SMALL, darknet_files
from tests.sarsim.dataset.small import toys

KINDS = 12  # of what is mutated: the tests that draw
COUNT = ceil(int(os.environ.get("SARSIM_MUTATIONS", "36")) / KINDS)
NUMBERS = [0, -1, 1, 1e-9, 1e300, 2**31, 2**63, 10**30, float("nan"), float("inf")]
ODD = [*NUMBERS, "", "x", "../..", "/tmp/else", None, [], {}]
"""What a number, a name or a list may become."""
SECONDS, BYTES = 20, 2_000_000_000
"""of processor time and memory that one case may take."""
ROOT = Path(__file__).parents[1]


@pytest.fixture(autouse=True)
def time_limit() -> Iterator[None]:
    """Let what takes too much time fail."""
    handler = signal.signal(signal.SIGPROF, lambda *_: pytest.fail(f"takes more than {SECONDS} s"))
    yield
    signal.signal(signal.SIGPROF, handler)


@contextmanager
def limited() -> Iterator[None]:
    """Let what takes too much memory or time fail."""
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + BYTES, before[1]))
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        resource.setrlimit(resource.RLIMIT_AS, before)


def draws() -> Iterator[np.random.Generator]:
    for seed in range(COUNT):
        yield np.random.default_rng(seed)


def files_below(folder: Path) -> set[Path]:
    return {path.relative_to(folder) for path in folder.rglob("*")}


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
    try:
        with limited():
            action()
    except InputError as error:
        assert str(error).strip()
        return True
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
    for rng in draws():
        path.write_text(with_odd_values(SMALL_ARENA, rng))
        results.append(refused(lambda: set_down(path)))
    assert any(results)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('pos="1 0.8', 'pos="nan 0.8', "geom_pos"),
        ('"0.005" g', '"nan" g', "timestep"),
        ('"0.005" g', '"0" g', "timestep"),
        ('iterations="50"', 'iterations="2000000000"', "iterations"),
        (HEIGHTS, 'nrow="40000" ncol="40000" size="0.3 0.3 0.1 0.05"', "more than 1 GB"),
        (
            HEIGHTS,
            'nrow="5000" ncol="5000" size="0.3 0.3 0.1 0.05"',
            "height fields have 25000000 cells; the limit is 2400000",
        ),
        ('shadowsize="1024"', 'numslices="100000"', "numslices"),
        ('extent="6"', 'extent="1e-300"', "extent"),
        ('scale="1 1 1"', 'scale="1e20 1e20 1e20"', "geom_pos"),
        ('nuser_geom="1"', 'nuser_geom="2000000000"', "arena.xml: "),
        ('nuser_geom="1"', 'nuser_geom="1000"', "nuser_geom"),
        ('znear="0.02"', 'znear="nan"', "znear"),
        ('width="64" height="64"', 'width="60000" height="60000"', "arena.xml: "),
        ('size="2 1.5 0.1"', 'size="150 150 0.1"', "too large: 300 × 300 m; .* 6000 m²"),
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
    for rng in draws():
        path.write_bytes(
            with_flips(good.encode(), rng) if rng.random() < 0.3 else with_odd_values(good, rng).encode()
        )
        results.append(refused(lambda: load_arena(str(path))))
    assert any(results)


def test_arrays_that_expand_endlessly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "map.npz"
    np.savez_compressed(path, a=np.zeros(10**6))
    assert path.stat().st_size < 10_000
    assert load_arrays(path, "map").keys() == {"a"}
    monkeypatch.setattr(files, "MAX_MEMORY", 10**6)
    with pytest.raises(InputError, match=r"map\.npz: unpacks to 8 MB; the limit is 1 MB"):
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
    cfg, weights = darknet_files(tmp_path)
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
    before = files_below(tmp_path)
    for number, rng in enumerate(draws()):
        is_scene = rng.random() < 0.5
        scene.write_bytes(with_flips(content, rng) if is_scene else content)
        entry = about["scenes"][1]
        forged = about | {"scenes": [about["scenes"][0], entry | {"sha256": sha256_of(scene)}]}  # forged, not damaged
        manifest.write_text(json.dumps(forged if is_scene else mutated(about, rng)))
        export = kind(tmp_path / "in" / "data", tmp_path / f"out{number}")
        results.append(refused(lambda: list(export.run())))  # noqa: B023
    assert {path for path in files_below(tmp_path) if not path.parts[0].startswith("out")} == before and any(results)


def test_robots(tmp_path: Path) -> None:
    good, path, arena, results = robot_file("jackal").read_text(), tmp_path / "robot.xml", tmp_path / "arena.xml", []
    arena.write_text(SMALL_ARENA)
    path.write_text(good)
    moved_about(arena, path)
    for rng in draws():
        path.write_bytes(
            with_flips(good.encode(), rng) if rng.random() < 0.2 else with_odd_values(good, rng).encode()
        )
        results.append(refused(lambda: moved_about(arena, path)))
    assert any(results)
    assert files_below(tmp_path) == {Path("robot.xml"), Path("arena.xml")}


def moved_about(arena: Path, robot: Path) -> None:
    """What an episode does to a robot."""
    with closing(SimulatedRobot(load_arena(str(arena)), SimulationConfig(robot=str(robot)), 0)) as body:
        mapper, frame = Mapper(body.model, TruthClassifier()), body.sense()
        mapper.add_frame(mapper.localise(frame))
        body.drive(Velocity(0.2, 0.2))


def test_settings(tmp_path: Path) -> None:
    path, results = tmp_path / "c.yaml", []
    for rng in draws():
        text = json.dumps(mutated({"seed": 3, "goals": [[1, 2]], "random": {"columns": 3}, "out": "x"}, rng))
        path.write_bytes(with_flips(text.encode(), rng) if rng.random() < 0.3 else text.encode())
        results.append(refused(lambda: load_settings(EpisodeConfig, path)))
    assert any(results)


FLAGS = ["seed", "steps", "goals", "dust", "start", "voxel-size", "speed", "map", "robot", "weights"]


def test_flags(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arena, results = tmp_path / "arena.xml", []
    arena.write_text(SMALL_ARENA)
    monkeypatch.chdir(tmp_path)
    good = ["--arena", str(arena), "--labels", "truth", "--detector", "None", "--steps", "1", "--out", "out"]
    one_step(good)  # imports what takes memory
    for rng in draws():
        pairs = [(f"--{rng.choice(FLAGS)}", str(ODD[rng.integers(len(ODD))])) for _ in range(rng.integers(1, 3))]
        results.append(refused(lambda: one_step([*good, *chain(*pairs)])))  # noqa: B023
    assert any(results)
    assert {path.parts[0] for path in files_below(tmp_path)} <= {"arena.xml", "out"}


def one_step(flags: list[str]) -> None:
    episode = Episode(settings_from(EpisodeConfig, flags))
    with suppress(LostError):
        episode.explorer.step()
    episode.recorder.close()
    episode.robot.close()


def test_recordings(tmp_path: Path) -> None:
    folder = write_tum_folder(tmp_path / "room", groundtruth=camera_poses(WAY), odometry=camera_poses(ODOMETRY))
    files, results = sorted(path for path in folder.rglob("*") if path.is_file()), []
    before = files_below(tmp_path)
    mapped(folder)
    for rng in draws():
        path = files[rng.integers(len(files))] if rng.random() < 0.3 else rng.choice(sorted(folder.glob("*.txt")))
        content = path.read_bytes()
        path.write_bytes(with_odd_word(content, rng) if rng.random() < 0.7 else with_flips(content, rng))
        results.append(refused(lambda: mapped(folder)))
        path.write_bytes(content)
    assert any(results)
    assert files_below(tmp_path) == before


def with_odd_word(content: bytes, rng: np.random.Generator) -> bytes:
    """One word of a text replaced."""
    words = content.split(b" ")
    words[rng.integers(len(words))] = str(ODD[rng.integers(len(ODD))]).encode()
    return b" ".join(words)


def mapped(folder: Path) -> None:
    """What ``map_recording.py`` does with a recording."""
    recording = read_tum_folder(folder)
    mapper = Mapper(PIONEER, RuleClassifier(), localisation=localisation_of("odometry"))
    with suppress(LostError):
        for _ in Replay(recording, mapper, "odometry"):
            pass


ROOM = [floor(-2, 6, -3, 3), wall((3.21, 2.31), (3.21, -2.29)), wall((1.01, 2.31), (3.21, 2.31))]
ON_ROBOT = pose(0.1, 0, 0.65, 0, 0.3)
AMISS: list[Callable[[Any, np.random.Generator], Any]] = [
    lambda frame, rng: replace(frame, depth=frame.depth * np.float32(rng.choice([0, np.nan, -1, 1.05, 99]))),
    lambda frame, rng: replace(frame, depth=rng.uniform(0, 4, frame.depth.shape).astype(np.float32)),
    lambda frame, rng: replace(frame, rgb=rng.integers(0, 256, frame.rgb.shape, np.uint8)),
    lambda frame, rng: replace(frame, T_odom_base=frame.T_odom_base * rng.choice([0, np.nan, 1e6])),
    lambda frame, rng: replace(frame, T_odom_base=from_yaw(*rng.choice([5, 1e3, 1e9], 3), 0)),
    lambda frame, rng: replace(frame, T_base_camera=frame.T_base_camera * rng.choice([0, np.nan, 1e6])),
    lambda frame, rng: replace(frame, time=rng.choice([-1e9, 0, 1e12])),
    lambda frame, rng: frame.nothing,  # raises
]
"""What may be wrong with a frame."""


class AmissRobot(KinematicRobot):
    """A robot in a room; from some frame on its camera or its odometry is faulty, once or for good."""

    def __init__(self, rng: np.random.Generator):
        super().__init__()
        self._rng, self._fault = rng, AMISS[rng.integers(len(AMISS))]
        self._first, self._lasts, self._frames = rng.integers(4), rng.random() < 0.5, 0

    def sense(self) -> Frame:
        self._frames += 1
        seen = look(ROOM, self.T @ ON_ROBOT, 0.004, self._frames)
        frame = replace(
            seen, T_base_camera=ON_ROBOT, T_odom_base=self.T, time=self.control_period * len(self.commands)
        )
        is_amiss = self._frames > self._first and (self._lasts or self._frames == self._first + 1)
        return self._fault(frame, self._rng) if is_amiss else frame

    def drive(self, command: Velocity) -> Motion:
        motion = super().drive(command)
        if self._frames > self._first and self._rng.random() < 0.01:
            odd = self._rng.choice([0, np.nan, 1e6])
            return replace(motion, T_odom_base=from_yaw(odd, odd, 0, 0), gyro=odd * motion.gyro)
        return motion


def test_faulty_robots(tmp_path: Path) -> None:
    for number, rng in enumerate(draws()):
        folder = tmp_path / str(number)
        folder.mkdir()
        refused(lambda: explored(AmissRobot(rng), folder))  # noqa: B023
        assert {path.name for path in folder.iterdir()} in (set(), MAPS)


MAPS = {"keyframes.npz", "metric_map.npz", "semantic_map.ply", "topology.json"}


def explored(robot: AmissRobot, folder: Path) -> None:
    """Steps of a robot, and the maps made until it fails."""
    explorer = Explorer(robot, Mapper(PIONEER, TruthClassifier(), localisation=Slam()))
    try:
        for _ in range(2):
            explorer.drive(explorer.step())
    except LostError:
        pass
    finally:
        if explorer.steps:
            run_all(explorer.apply_corrections, lambda: save_maps(explorer.mapper, folder))
