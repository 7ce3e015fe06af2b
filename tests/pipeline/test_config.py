"""The numbers of a run's one tree are those that the whole robot uses: nobody forgets to pass them on."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.config import PipelineConfig
from pipeline.elevation_map.config import ElevationConfig, PathCosts, TraversabilityConfig
from pipeline.errors import InputError
from pipeline.exploration.config import ExplorationConfig, VisibilityConfig
from pipeline.explorer import Explorer
from pipeline.frame import Frame
from pipeline.localisation.config import (
    BeliefConfig,
    KeyframePolicy,
    LoopConfig,
    OdometryConfig,
    PoseCheckConfig,
    RegistrationConfig,
    SlamConfig,
    TrajectoryConfig,
)
from pipeline.navigation.config import ObstacleCheckConfig, SpeedLimitConfig
from pipeline.planning.stretches import ArcConfig
from pipeline.plugins.finds.config import CodesConfig, FindsConfig, HazmatConfig, ShapesConfig, SquaresConfig
from pipeline.rerun.config import RerunConfig
from pipeline.rescue_report.config import RescueReportConfig
from pipeline.segments.config import SegmentsConfig
from pipeline.semantic_map.config import NetworkConfig, RuleConfig
from pipeline.topological_map.config import TopologicalMapConfig
from pipeline.tracks.config import Confirmation, ObjectConfig, PeopleConfig, ReobservationConfig, TracksConfig
from pipeline.tracks.find import KINDS
from pipeline.tracks.finds import Finds
from pipeline.transforms import from_yaw
from pipeline.victims.config import DetectorConfig, HeatConfig
from pipeline.victims.detection import Detection
from pipeline.victims.victim_map import Victims
from sarsim.composition import make_mapper
from sarsim.methods.make import make_exploration
from sarsim.methods.plugins import make_plugins
from sarsim.settings import PerceptionConfig, SinkConfig
from tests.config_audit import Audit, fresh
from tests.pipeline.kinematic_robot import KinematicRobot
from tests.pipeline.localisation.carried_robot import ROOM, seen
from tests.pipeline.robot_model import PIONEER


class SeeingRobot(KinematicRobot):
    """Sees a room and how warm it is, with perfect odometry."""

    def __init__(self) -> None:
        super().__init__()
        self.T = from_yaw(1.0, 2.0, 0.0, 0.0)

    def sense(self) -> Frame:
        frame, thermal = seen(ROOM, self.T, seed=len(self.commands)), np.full((60, 80), 20.0, np.float32)
        thermal[20:30, 20:30] = 30.0
        return replace(frame, time=float(len(self.commands)), thermal=thermal)


class SeesEverything:
    """A detector that finds an object of every kind in the middle of each image."""

    def detect(self, rgb: NDArray[np.uint8]) -> list[Detection]:
        height, width, _ = rgb.shape
        return [Detection((0.4 * width, 0.4 * height, 0.6 * width, 0.7 * height), 0.9, kind) for kind in KINDS]


@pytest.mark.parametrize(
    ("labels", "exploration", "steps"), [("pointnext", "next_best_view", 1), ("rules", "nearest_frontier", 2)]
)
def test_all_numbers_are_those_of_the_one_tree(labels: str, exploration: str, steps: int) -> None:
    """The second robot looks for no people and finds, but sees how a second keyframe differs from the first."""
    config, robot = fresh(PipelineConfig()), SeeingRobot()
    assert config == PipelineConfig()
    perception = PerceptionConfig(labels=labels, pipeline=config)
    finds = fresh(FindsConfig())
    audit = Audit(config, finds)
    with audit.calls():
        if steps == 1:
            mapper = make_mapper(perception, PIONEER, plugins=make_plugins(SinkConfig(plugins={"finds": finds})))
        else:
            mapper = make_mapper(replace(perception, detector=None), PIONEER)
        explorer = Explorer(robot, mapper, make_exploration(exploration, PIONEER, config=config.exploration))
        for _ in range(steps):
            explorer.drive(explorer.step())
        if steps == 1:
            frame, T_map_base = robot.sense(), mapper.keyframes.poses[-1]
            detections = SeesEverything().detect(frame.rgb)
            assert mapper.readers is not None
            mapper.victims.update(frame, detections, T_map_base @ frame.T_base_camera, 0)
            mapper.finds.update(frame, mapper.readers.read(frame, detections), T_map_base, 0)
        assert len(mapper.semantic_map.labels())
    audit.note_held(explorer, mapper)
    assert audit.foreign == set()


class Half:
    """Passes on one of two configs."""

    def __init__(self, config: PipelineConfig) -> None:
        self.victims, self.tracks = config.victims, TracksConfig()


def test_a_config_that_is_not_passed_on_is_seen() -> None:
    config = fresh(PipelineConfig())
    held, called = Audit(config), Audit(config)
    held.note_held([partial(print, Half(config))])
    assert held.foreign == {"Half: TracksConfig"}
    victims = Victims()
    with called.calls():
        Finds(victims, config.tracks)
        assert called.foreign == set()
        Finds(victims, TracksConfig())
    assert called.foreign == {"tracks/finds.py Finds.__init__: TracksConfig"}


@pytest.mark.parametrize(
    ("config", "field", "wrong"),
    [
        (KeyframePolicy, "distance", 0.0),
        (KeyframePolicy, "labelled_every", 0),
        (RegistrationConfig, "iterations", 0),
        (OdometryConfig, "translation_sigma", 0.0),
        (RegistrationConfig, "confidence", 1.0),
        (RegistrationConfig, "chance_overlap", 0.0),
        (OdometryConfig, "added_distance", 0.0),
        (BeliefConfig, "distance_between_faults", 0.0),
        (BeliefConfig, "confidence", 1.0),
        (BeliefConfig, "confidence", 0.5),
        (LoopConfig, "confidence", 1.0),
        (SlamConfig, "local_deviation", 0.0),
        (SlamConfig, "max_connections", -1),
        (TrajectoryConfig, "max_interpolation_gap", -0.1),
        (PoseCheckConfig, "views_per_turn", 2),
        (VisibilityConfig, "stride", 0),
        (VisibilityConfig, "rays", 12),
        (ExplorationConfig, "time_growth", 1.0),
        (ObstacleCheckConfig, "ahead", 0.0),
        (ObstacleCheckConfig, "angle_between_checks", -0.1),
        (ObstacleCheckConfig, "min_returns", 0),
        (SpeedLimitConfig, "speed_near_people", 0.0),
        (SpeedLimitConfig, "arc_lag", 0.0),
        (SpeedLimitConfig, "beside_people", -1.0),
        (ArcConfig, "radii", (0.3, 0.0)),
        (ArcConfig, "spacing", 0.0),
        (ArcConfig, "min_angle", -0.1),
        (TopologicalMapConfig, "max_detour", 0.9),
        (SegmentsConfig, "angle", 2.0),
        (SegmentsConfig, "checkpoint_interval", 0),
        (ElevationConfig, "cell", 0.0),
        (TraversabilityConfig, "leniency", -0.1),
        (PathCosts, "turn_pace", 0.0),
        (RuleConfig, "min_ceiling_height", 0.01),
        (NetworkConfig, "grids", 0),
        (DetectorConfig, "size", (100, 96)),
        (DetectorConfig, "confidence", 1),
        (DetectorConfig, "min_corroboration", 0),
        (HeatConfig, "min_temperature_excess", 0.0),
        (Confirmation, "misses", 0.0),
        (ObjectConfig, "min_readable_side", 0.0),
        (PeopleConfig, "evidence_to_look", -0.1),
        (ReobservationConfig, "max_tries", -1),
        (SquaresConfig, "hue_step", 0),
        (SquaresConfig, "window", 50),
        (SquaresConfig, "small_window", 1),
        (SquaresConfig, "tolerances", ()),
        (HazmatConfig, "sizes", ()),
        (CodesConfig, "read_side", 0),
        (ShapesConfig, "stride", 0),
        (ShapesConfig, "spreads", 0),
        (RerunConfig, "point_spacing", 0.0),
        (RescueReportConfig, "drop", 0),
    ],
)
def test_a_number_that_cannot_work_is_refused(config: type, field: str, wrong: object) -> None:
    with pytest.raises(InputError, match=re.escape(f"{field} = {wrong}: must be")):
        config(**{field: wrong})


def test_nodes_may_see_as_far_as_250_cells() -> None:
    fine = ElevationConfig(cell=0.03)
    assert PipelineConfig(elevation_map=fine, topological_map=TopologicalMapConfig(sight=7.5)).elevation_map == fine
    with pytest.raises(InputError, match=r"sight = 7\.6"):
        PipelineConfig(elevation_map=fine, topological_map=TopologicalMapConfig(sight=7.6))


@pytest.mark.parametrize("kind", ["fire_extinguisher", "door_lever"])
def test_a_kind_that_is_sought_by_its_extents_must_have_some(kind: str) -> None:
    with pytest.raises(InputError, match=rf"{kind}\.extents = \(\): must be"):
        FindsConfig(**{kind: ObjectConfig()})
