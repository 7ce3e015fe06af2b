"""Methods of one's own: the examples of the page, what is refused, and how it is said."""

import re
import sys
from dataclasses import dataclass
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import numpy as np
import pytest
from dm_control import mjcf

from pipeline.errors import InputError
from pipeline.exploration.baselines import NearestFrontier, RandomWalk
from pipeline.exploration.mission import Mission
from pipeline.exploration.viewpoint import Context, Viewpoint
from pipeline.localisation.config import LocalisationConfig
from pipeline.localisation.odometry import OdometryLocalisation
from pipeline.localisation.slam import Slam
from pipeline.planning.path_plan import TOPOLOGICAL
from pipeline.robot import RobotModel
from pipeline.semantic_map.classifier import PointClassifier, check_probabilities
from pipeline.sink import Sink
from pipeline.transforms import from_yaw
from pipeline.victims.detection import Detection, Detector, check_detections
from pipeline.victims.readers import FindReader
from sarsim import settings
from sarsim.arenas.arena import RescueArena
from sarsim.methods import make, names
from sarsim.methods.arena import make_arena
from tests.pipeline.robot_model import PIONEER

PAGE = Path(__file__).parents[3] / "docs" / "extend.md"
MAKE = {
    "exploration": lambda name: make.make_exploration(name, PIONEER),
    "planner": lambda name: make.make_planner(name, PIONEER),
    "localisation": lambda name: make.make_localisation(name, PIONEER, LocalisationConfig()),
    "labels": lambda name: make.make_own("labels", name, PointClassifier),
    "detector-class": lambda name: make.make_own("detector-class", name, Detector),
    "reader": lambda name: make.make_own("reader", name, FindReader),
    "sink": lambda name: make.make_own("sink", name, Sink),
    "arena": lambda name: make_arena(name, seed=2),
}


@pytest.fixture(autouse=True)
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder, whose modules are forgotten afterwards."""
    monkeypatch.chdir(tmp_path)
    for name in ("page", "broken"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return tmp_path


@pytest.fixture
def page(workplace: Path) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.DOTALL | re.MULTILINE)
    (workplace / "page.py").write_text("\n".join(blocks))


@dataclass(frozen=True, slots=True)
class Silent:
    """A strategy with exactly the methods that the interface demands, and to whose instances nothing can be added."""

    robot: RobotModel

    def observe(self, context: Context) -> None:
        pass

    def next_viewpoint(self, context: Context) -> None:
        pass

    def commit(self, viewpoint: Viewpoint, context: Context) -> None:
        pass


class Broken(Silent):
    def __init__(self, robot: RobotModel):
        raise KeyError("of the researcher's own")


def no_arena() -> str:
    return "nist_6x4"


def broken_arena(seed: int) -> None:
    raise ValueError(f"no arena {seed}")


def unbuilt_arena() -> RescueArena:
    root = mjcf.RootElement()
    root.worldbody.add("site", name="start")
    root.worldbody.add("geom", type="box", size=[0.0, 1.0, 1.0])
    return RescueArena(root)


def shut_arena() -> RescueArena:
    return RescueArena(mjcf.RootElement())


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
def test_the_examples_of_the_page_are_accepted(flag: str, name: str) -> None:
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


def test_what_a_strategy_need_not_have_may_be_missing() -> None:
    strategy = make.make_exploration(f"{__name__}:Silent", PIONEER)
    assert type(strategy) is Silent
    mission = Mission(strategy)
    assert mission.leftovers(None) == [] and not mission.is_shown(None)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("flag", "name", "said"),
    [
        ("exploration", "nearest", "next_best_view, nearest_frontier, random_walk or MODULE:CLASS"),
        ("detector-class", "mine", "MODULE:CLASS"),
        ("labels", "no_such_module:Mine", "No module named 'no_such_module'"),
        ("labels", "json:Mine", "has no attribute 'Mine'"),
        ("labels", "json:dumps", "class"),
        ("labels", "json:JSONDecoder", "has no classify; .* pipeline.semantic_map.classifier.PointClassifier"),
        ("localisation", f"{__name__}:Silent", "has no T_map_odom, add, .*set_pose; "),
        ("reader", "json:JSONDecoder", "has no read"),
        ("sink", "json:JSONDecoder", "has no .*finish, .*on_motion, on_step"),
        ("arena", f"{__name__}:no_arena", "str"),
        ("arena", f"{__name__}:unbuilt_arena", "MuJoCo"),
        ("arena", f"{__name__}:PAGE", "function"),
        ("arena", "no_such_module:hall", "no_such_module"),
    ],
)
def test_what_is_no_method_is_refused_in_one_line(flag: str, name: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as refused:
        MAKE[flag](name)
    assert re.match(f"--{flag} {name}\\b", str(refused.value))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("change", "kept"),
    [("append('/of/its/own')", ["/earlier", "/of/its/own"]), ("remove(os.getcwd())", ["/earlier"])],
)
def test_folders_that_a_module_adds_to_the_path_stay_there(
    change: str, kept: list[str], workplace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", ["/earlier"])
    (workplace / "broken.py").write_text(f"import os, sys\nsys.path.{change}\n\n\nclass Mine:\n    pass\n")
    assert names.load_own("sink", "broken:Mine", names.OWN_CLASS).__name__ == "Mine"
    assert sys.path == kept


def test_the_working_folder_keeps_its_place_on_the_path(workplace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given = [str(workplace), "/later"]
    monkeypatch.setattr(sys, "path", [*given])
    with names.working_folder():
        assert sys.path == given
    assert sys.path == given


def test_an_error_in_code_of_ones_own_is_ones_own(workplace: Path) -> None:
    (workplace / "broken.py").write_text("import no_such_module\n")
    with pytest.raises(ModuleNotFoundError, match="no_such_module"):
        MAKE["labels"]("broken:Mine")
    with pytest.raises(KeyError, match="of the researcher's own"):
        MAKE["exploration"](f"{__name__}:Broken")
    with pytest.raises(ValueError, match=r"^no arena 2$"):
        MAKE["arena"](f"{__name__}:broken_arena")
    with pytest.raises(InputError, match="'start'"):
        MAKE["arena"](f"{__name__}:shut_arena")


@pytest.mark.parametrize(
    "answer", [None, [[0.125] * 8] * 3, np.full((3, 7), 1 / 7), np.full((4, 8), 0.125), np.full((3, 8), np.nan)]
)
def test_probabilities_that_would_spoil_the_map_are_refused(answer: object) -> None:
    check_probabilities(np.full((3, 8), 0.125), 3, object())
    with pytest.raises(InputError, match=r"^object.classify: .*\(3, 8\)"):
        check_probabilities(answer, 3, object())


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64])
@pytest.mark.parametrize("wrong", [[0.0] * 8, [-2.1] * 8, [0.13] * 8, [1.5, -0.5, *[0.0] * 6]])
def test_probabilities_of_each_point_are_not_negative_and_sum_to_1(kind: type, wrong: list[float]) -> None:
    answer: np.ndarray = np.random.default_rng(0).dirichlet(np.ones(8), 100_000).astype(kind)
    check_probabilities(answer, len(answer), object())
    check_probabilities(answer[:0], 0, object())
    answer[500] = wrong
    with pytest.raises(InputError, match=r"^object.classify: .*the sum 1"):
        check_probabilities(answer, len(answer), object())


@pytest.mark.parametrize(
    "answer",
    [
        "none",
        [(0, 0, 1, 1)],
        [Detection((0, 0, 1), 0.5)],  # type: ignore[arg-type]
        [Detection((0, 0, 1, np.nan), 0.5)],
        [Detection((0, 0, 1, 1), np.nan)],
        [Detection((0, 0, 1, 1), 1.01)],
        [Detection((0, 0, 1, 1), -0.01)],
        [Detection((0, 0, 1, 1), 0.5, "cat")],
    ],
)
def test_detections_that_would_spoil_the_map_are_refused(answer: object) -> None:
    check_detections([Detection((0, 0, 1, 1), sure) for sure in (0, 0.5, 1)], object())
    with pytest.raises(InputError, match=r"^object.detect: "):
        check_detections(answer, object())


@pytest.mark.usefixtures("page")
def test_the_robot_is_set_down_where_it_is_asked_for_in_an_arena_of_ones_own() -> None:
    np.testing.assert_array_equal(make_arena("page:hall", seed=1).T_world_start, np.eye(4))
    moved = make_arena("page:hall", (0.5, 0.25, 90.0), seed=1).T_world_start
    np.testing.assert_allclose(moved, from_yaw(0.5, 0.25, 0, np.pi / 2), atol=1e-9)
    with pytest.raises(InputError, match="page:hall"):
        make_arena("page:hall", (50.0, 0.0, 0.0), seed=1)


def test_classes_come_from_installed_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    entries = EntryPoints([EntryPoint("silent", f"{__name__}:Silent", "sarsim.exploration")])
    monkeypatch.setattr(names, "entry_points", entries.select)
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
