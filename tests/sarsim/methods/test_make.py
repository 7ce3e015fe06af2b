"""Methods of one's own: the examples of the page, what is refused, and how it is said."""

import re
import sys
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import numpy as np
import pytest
from dm_control import mjcf

from pipeline.errors import InputError
from pipeline.exploration.baselines import NearestFrontier, RandomWalk
from pipeline.exploration.viewpoint import Context, Viewpoint
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.localisation import Localised, LostError
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.localisation.slam import Slam
from pipeline.planning.path_plan import TOPOLOGICAL
from pipeline.robot import RobotModel
from pipeline.sink import Sink
from pipeline.tracks.find import Reading
from pipeline.transforms import from_yaw
from sarsim import settings
from sarsim.arenas.arena import RescueArena
from sarsim.methods import make, names
from sarsim.methods.arena import make_arena
from sarsim.methods.level_ground import level_context
from tests.pipeline.robot_model import PIONEER

PAGE = Path(__file__).parents[3] / "docs" / "extend.md"
MAKE = {
    "exploration": lambda name: make.make_exploration(name, PIONEER),
    "planner": lambda name: make.make_planner(name, PIONEER),
    "localisation": lambda name: make.make_localisation(name, PIONEER, LocalisationConfig()),
    "labels": make.own_classifier,
    "detector-class": make.own_detector,
    "reader": make.own_reader,
    "sink": make.own_sink,
    "arena": lambda name: make_arena(name, seed=2),
}


@pytest.fixture(autouse=True)
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder, whose modules are forgotten afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "page", raising=False)
    return tmp_path


@pytest.fixture
def page(workplace: Path) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.DOTALL | re.MULTILINE)
    (workplace / "page.py").write_text("\n".join(blocks))


class Silent:
    """A strategy with exactly the protocol's methods."""

    answer: object = None

    def __init__(self, robot: RobotModel):
        self.robot = robot

    def observe(self, context: Context) -> None:
        pass

    def next_viewpoint(self, context: Context) -> object:
        return self.answer

    def commit(self, viewpoint: Viewpoint, context: Context) -> None:
        pass


class Greedy(Silent):
    def next_viewpoint(self, context: Context, more: int) -> None:  # type: ignore[override]
        pass


class Broken(Silent):
    def observe(self, context: Context) -> None:
        raise KeyError("first\nsecond")


class Unmade(Silent):
    def __init__(self) -> None:
        pass


class Talkative(Silent):
    answer = (1.0, 2.0)


class Nowhere(Silent):
    answer = Viewpoint(np.array([np.nan, 0]), 0.0, True, 0.0)


class Far(Silent):
    answer = Viewpoint(np.array([90.0, 0]), 0.0, True, 0.0)


class Labels:
    def __init__(self, shape: tuple[int, ...] = (3, 8), value: float = 0.125):
        self.answer = np.full(shape, value, np.float32)

    def classify(self, frame: object, points: np.ndarray, T_map_camera: object) -> object:
        return self.answer


class Improbable(Labels):
    def classify(self, frame: object, points: np.ndarray, T_map_camera: object) -> object:
        return np.ones((len(points), 8), np.float32)


class Boxes:
    answer: object = "none"

    def detect(self, rgb: np.ndarray) -> object:
        return self.answer


class Readings:
    kind, corners, confidence = "red_square", np.array([[1, 1], [9, 1], [9, 9]], np.float32), 0.5

    def read(self, frame: object, detections: object) -> object:
        return [Reading(self.kind, "", self.corners, self.confidence)]


class Person(Readings):
    kind = "victim"


class Shouted(Readings):
    kind = "Red!"


class Outside(Readings):
    corners = np.array([[1, 1], [9000, 1], [9, 9]], np.float32)


class Flattened(Readings):
    corners = np.array([[1, 1], [5, 1], [9, 1]], np.float32)


class Sure(Readings):
    confidence = 2.0


class Deaf:
    def finish(self, result: object) -> None:
        pass


class Loud(Sink):
    def on_keyframe(self, keyframe: object) -> None:
        raise ValueError("no\nkeyframe")


def no_arena() -> str:
    return "nist_6x4"


def broken_arena(seed: int) -> None:
    raise ValueError(f"no arena\n{seed}")


def unbuilt_arena() -> RescueArena:
    root = mjcf.RootElement()
    root.worldbody.add("site", name="start")
    root.worldbody.add("geom", type="box", size=[0.0, 1.0, 1.0])
    return RescueArena(root)


def shut_arena() -> RescueArena:
    return RescueArena(mjcf.RootElement())


class Adrift(OdometryLocalisation):
    def __init__(self, robot: RobotModel):
        super().__init__()

    def localise(self, frame: object) -> Localised:  # type: ignore[override]
        return Localised(frame, np.zeros((4, 4)))  # type: ignore[arg-type]


class Lost(Adrift):
    def localise(self, frame: object) -> Localised:  # type: ignore[override]
        raise LostError("no pose")


class Wayless:
    def __init__(self, robot: RobotModel):
        pass

    def plan(self, topology: object, paths: object, goal: object, heading: float | None = None) -> object:
        return [goal]


@pytest.mark.usefixtures("page")
@pytest.mark.parametrize(
    ("flag", "name"),
    [
        ("exploration", "Ahead"),
        ("planner", "Careful"),
        ("localisation", "Flat"),
        ("labels", "Low"),
        ("detector-class", "Bright"),
        ("reader", "Red"),
        ("sink", "Poses"),
    ],
)
def test_the_examples_of_the_page_pass_the_trial(flag: str, name: str) -> None:
    path = list(sys.path)
    assert type(MAKE[flag](f"page:{name}")).__name__ == name
    assert sys.path == path


def test_shipped_methods_have_names() -> None:
    assert make.make_exploration("next_best_view", PIONEER) is None
    assert type(make.make_exploration("nearest_frontier", PIONEER)) is NearestFrontier
    assert type(make.make_exploration("random_walk", PIONEER, 3)) is RandomWalk
    assert make.make_planner("topological", PIONEER) is TOPOLOGICAL
    assert type(make.make_localisation("slam", PIONEER, LocalisationConfig())) is Slam
    assert type(make.make_localisation("slam", PIONEER, LocalisationConfig(), is_true=True)) is OdometryLocalisation
    assert type(make.make_localisation("odometry", PIONEER, LocalisationConfig())) is OdometryLocalisation


def test_what_the_protocol_has_a_default_for_may_be_missing() -> None:
    strategy = make.make_exploration(f"{__name__}:Silent", PIONEER)
    assert strategy is not None and strategy.leftovers(level_context(PIONEER)) == []


@pytest.mark.usefixtures("page")
def test_the_trial_leaves_no_trace() -> None:
    strategy, context, named = make.make_exploration("page:Ahead", PIONEER), level_context(PIONEER), []
    assert strategy is not None
    for _ in range(3):
        strategy.observe(context)
        named.append(strategy.next_viewpoint(context) is not None)
    assert named == [True, True, False]


@pytest.mark.parametrize(
    ("flag", "name", "said"),
    [
        ("exploration", "nearest", "next_best_view, nearest_frontier, random_walk or MODULE:CLASS"),
        ("detector-class", "mine", "MODULE:CLASS"),
        ("labels", "no_such_module:Mine", "No module named 'no_such_module'"),
        ("labels", "json:Mine", "has no attribute 'Mine'"),
        ("labels", "json:dumps", "class"),
        ("labels", "json:JSONDecoder", "has no method classify.* pipeline.semantic_map.classifier.Point"),
        ("exploration", "Greedy", "next_viewpoint: must be callable with one argument: TypeError: missing"),
        ("exploration", "Broken", "observe failed: KeyError: 'first\\\\nsecond'"),
        ("exploration", "Unmade", "creating an instance failed: TypeError"),
        ("exploration", "Talkative", "Viewpoint or None, not a tuple"),
        ("exploration", "Nowhere", "position"),
        ("exploration", "Far", "is outside the mapped area"),
        ("labels", "Labels", "probabilities"),
        ("labels", "Improbable", "sum to 1"),
        ("detector-class", "Boxes", "list of Detection objects, not a str"),
        ("localisation", "Silent", "has no method localise|has no attribute"),
        ("localisation", "Adrift", "T_map_base must be a rigid"),
        ("planner", "Wayless", "PathPlan or None, not a list"),
        ("reader", "Boxes", "has no method read"),
        ("reader", "Person", "'victim'"),
        ("reader", "Shouted", "'Red!'"),
        ("reader", "Outside", "corners .* must lie inside the image"),
        ("reader", "Flattened", "corners .* must differ in both x and y"),
        ("reader", "Sure", "confidence .* from 0 to 1, not 2.0"),
        ("sink", "Deaf", "has no method on_"),
        ("arena", f"{__name__}:no_arena", "str"),
        ("arena", f"{__name__}:broken_arena", "no arena 2"),
        ("arena", f"{__name__}:unbuilt_arena", "MuJoCo"),
        ("arena", f"{__name__}:shut_arena", "'start'"),
        ("arena", f"{__name__}:PAGE", "function"),
        ("arena", "no_such_module:hall", "no_such_module"),
    ],
)
def test_what_is_no_method_is_refused_in_one_line(flag: str, name: str, said: str) -> None:
    name = name if ":" in name or name[0].islower() else f"{__name__}:{name}"
    with pytest.raises(InputError, match=said) as refused:
        MAKE[flag](name)
    assert re.match(f"--{flag} {name}\\b", str(refused.value))
    assert "\n" not in str(refused.value)


def test_a_method_is_watched_after_the_trial() -> None:
    strategy = make.make_exploration(f"{__name__}:Silent", PIONEER)
    assert isinstance(strategy, Silent)
    strategy.answer = Viewpoint(np.array([np.inf, 0]), 0.0, True, 0.0)
    with pytest.raises(InputError, match="position"):
        strategy.next_viewpoint(level_context(PIONEER))


def test_a_sink_is_watched_and_what_it_does_not_override_is_ignored() -> None:
    sink = make.own_sink(f"{__name__}:Loud")
    sink.on_motion(None)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=f"^--sink {__name__}:Loud: on_keyframe .*no keyframe$"):
        sink.on_keyframe(None)  # type: ignore[arg-type]


@pytest.mark.usefixtures("page")
def test_the_robot_is_set_down_where_it_is_asked_for_in_an_arena_of_ones_own() -> None:
    np.testing.assert_array_equal(make_arena("page:hall", seed=1).T_world_start, np.eye(4))
    moved = make_arena("page:hall", (0.5, 0.25, 90.0), seed=1).T_world_start
    np.testing.assert_allclose(moved, from_yaw(0.5, 0.25, 0, np.pi / 2), atol=1e-9)
    with pytest.raises(InputError, match="page:hall"):
        make_arena("page:hall", (50.0, 0.0, 0.0), seed=1)


def test_a_localisation_may_say_that_it_is_lost() -> None:
    with pytest.raises(LostError, match="no pose"):
        make.make_localisation(f"{__name__}:Lost", PIONEER, LocalisationConfig())


def test_classes_come_from_installed_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = EntryPoint("silent", f"{__name__}:Silent", "sarsim.exploration")

    def installed(**wanted: str) -> EntryPoints:
        return EntryPoints([entry]).select(**wanted)

    monkeypatch.setattr(names, "entry_points", installed)
    assert isinstance(make.make_exploration("silent", PIONEER), Silent)
    with pytest.raises(InputError, match="random_walk, silent or MODULE:CLASS"):
        make.make_exploration("loud", PIONEER)


@pytest.mark.usefixtures("page")
def test_arenas_come_from_installed_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    entries = EntryPoints([EntryPoint("hall", "page:hall", "sarsim.arena")])
    for module in (names, settings):
        monkeypatch.setattr(module, "entry_points", entries.select)
    monkeypatch.syspath_prepend(".")
    assert make_arena("hall").mjcf_model.model == "hall"
    with pytest.raises(InputError, match="halls"):
        make_arena("halls")
