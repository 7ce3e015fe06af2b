"""The simulated robot and an explorer by topics: the files of both, also if one of them stops sending."""

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.metric_map.io.npz import load_metric_map
from pipeline.plugins.league.brief import HANDED_IN
from pipeline.plugins.league.validation import validate
from pipeline.plugins.ros import messages
from pipeline.plugins.ros.live.actions import GoalEnd
from pipeline.robot import Velocity
from pipeline.transforms import yaw_of
from sarsim.plugins.ros.ros_drive import RosDrive
from sarsim.plugins.ros.settings import RosExplorationConfig, RosRobotConfig
from sarsim.plugins.ros.simulated_node import WATCHDOG_TIMEOUT, SimulatedNode
from tests.pipeline.plugins.ros.live.loopback import End, Wire
from tests.pipeline.plugins.ros.live.nav2_stack import Nav2Stack
from tests.sarsim.rooms import HOUSE

FILES = {
    "episode.rrd", "finds.json", "keyframes.npz", "metric_map.npz", "report.html", "report.json", "semantic_map.ply",
    "topology.json", "trajectory_estimated.tum", "victims.csv", "victims.json",
}  # fmt: skip


class Pair:
    """The simulated robot and an explorer, which wait for each other; the robot's time serves as wall-clock time."""

    def __init__(self, folder: Path, **config: object):
        self.wire = Wire()
        (folder / "house.xml").write_text(HOUSE)
        robot = RosRobotConfig(arena=str(folder / "house.xml"), out=folder / "truth")
        self.simulated = SimulatedNode(robot, End(self.wire, "robot"))
        self.nav2 = Nav2Stack(self.wire) if config.get("nav2") else None
        end = End(self.wire, "explorer")
        end.work = self.work
        self.out = folder / "run"
        settings = {"steps": 2, "labels": "rules", "detector": None} | config
        self.drive = RosDrive(RosExplorationConfig(out=self.out, **settings), end)  # type: ignore[arg-type]

    def work(self) -> None:
        self.wire.time += self.simulated.robot.control_period
        self.simulated.run_period()

    @property
    def report(self) -> dict:
        return json.loads((self.out / "report.json").read_text())


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Pair:
    pair = Pair(tmp_path_factory.mktemp("ros"))
    assert pair.drive.run()
    return pair


def test_it_explores_and_leaves_the_files_of_an_episode(driven: Pair) -> None:
    assert {path.name for path in driven.out.iterdir()} == FILES
    report = driven.report
    assert report["steps"] == 2
    assert report["navigation"]["legs"] == report["navigation"]["reached"] > 0
    assert report["localisation"]["keyframes"] > 2
    assert len(load_metric_map(driven.out / "metric_map.npz").occupied_centres()) > 300


def test_the_robot_knows_the_truth_and_says_it_of_keyframes_alone(driven: Pair) -> None:
    truth = driven.simulated.report()
    assert truth["navigation"]["tipped"] == 0
    assert np.ptp([yaw_of(pose.T_world_base) for pose in driven.simulated.robot.trajectory]) > 0.3
    assert 0.1 < truth["exploration"]["explored_fraction"] < 0.9
    assert "/ground_truth/pose" not in driven.wire.heard
    assert "/camera/label/image_raw" not in driven.wire.heard


def test_where_it_believes_to_be_is_where_it_is(driven: Pair) -> None:
    true = {round(pose.time, 3): pose.T_world_base for pose in driven.simulated.robot.trajectory}
    rows = np.loadtxt(driven.out / "trajectory_estimated.tum")
    errors = [np.linalg.norm(true[round(row[0], 3)][:2, 3] - row[1:3]) for row in rows]
    assert len(errors) > 50
    assert max(errors) < 0.05


def test_it_publishes_its_maps(driven: Pair) -> None:
    grid = driven.wire.heard["/map"][-1]
    assert set(grid.data) == {-1, 0, 100}
    for topic in ("/keyframe", "/semantic_cloud", "/plan", "/path", "/markers", "/tf"):
        assert driven.wire.heard[topic], topic


def test_a_command_holds_for_half_a_second(driven: Pair) -> None:
    robot, wire = driven.simulated.robot, driven.wire
    for command in (Velocity(-0.3), Velocity(np.nan, 0.2)):
        before = robot.trajectory[-1].T_world_base
        wire.carry("/cmd_vel", messages.velocity(command))
        for _ in range(round((WATCHDOG_TIMEOUT + 1.0) / robot.control_period)):
            driven.work()
        way = np.linalg.norm(robot.trajectory[-1].T_world_base[:2, 3] - before[:2, 3])
        at_rest = np.linalg.norm(robot.trajectory[-1].T_world_base[:2, 3] - robot.trajectory[-5].T_world_base[:2, 3])
        assert (way > 0.01) == np.isfinite(command.v)
        assert at_rest < 0.001


def test_where_the_robot_falls_silent_what_was_mapped_is_kept(tmp_path: Path) -> None:
    pair = Pair(tmp_path, mission="league", patience=1.0)

    def falls_silent(topic: str, time: float, message: object) -> list:
        gone = topic == "/odom" and len(pair.drive.explorer.mapper.keyframes) > 1
        return [] if gone else [(topic, time, message)]

    pair.wire.change = falls_silent
    with pytest.raises(InputError, match=r"/odom: .*1 s"):
        pair.drive.run()
    assert {path.name for path in pair.out.iterdir()} == FILES | {HANDED_IN}
    assert validate(pair.out) == []
    assert pair.report["stopped"].startswith("/odom")
    assert messages.command_of(pair.wire.heard["/cmd_vel"][-1]) == Velocity()


def test_its_nav2_drives_it_where_it_is_to_explore(tmp_path: Path) -> None:
    pair = Pair(tmp_path, nav2=True, steps=1, goals=((0.9, 0.9),))
    assert pair.drive.run()
    assert {path.name for path in pair.out.iterdir()} == FILES
    report = pair.report
    assert report["navigation"]["legs"] == report["navigation"]["reached"] > 0
    assert report["goals"]["reached"] == 1
    assert report["localisation"]["keyframes"] > 3
    assert pair.nav2 and set(pair.nav2.ends) == {GoalEnd.SUCCEEDED}
    assert pair.wire.publishers["/cmd_vel"] == ["nav2"]
    assert pair.simulated.report()["navigation"]["distance_m"] > 1.0
    assert {"/map", "/tf", "/keyframe"} <= set(pair.wire.heard)


def test_an_interrupted_drive_of_nav2_ends_and_a_robot_with_a_map_gets_no_other(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    pair = Pair(tmp_path, nav2=True)
    link = messages.transforms(pair.wire.time, {("map", "odom"): np.eye(4)})
    End(pair.wire, "slam").publish("/tf", pair.wire.time, link)
    assert pair.nav2
    assert not pair.drive.run(lambda: bool(pair.nav2 and pair.nav2.goals))
    assert pair.nav2.ends == [GoalEnd.CANCELED]
    assert {path.name for path in pair.out.iterdir()} == FILES
    assert "/map" not in pair.wire.heard
    assert "own map" in caplog.text
