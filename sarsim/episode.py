"""An episode: an expedition in a simulated arena, and its score."""

from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.explorer import Explorer, Observer
from pipeline.files import check_folder, each, make_folder
from pipeline.league.brief import MissionBrief
from pipeline.map_file import KEYFRAMES, load_keyframes
from pipeline.mapper import Mapper
from pipeline.rerun.viewer import Viewer
from pipeline.robot import Robot
from pipeline.ros.recorded_robot import ExplorerBag, RecordedRobot
from pipeline.ros.topics import Joints
from pipeline.run import Expedition, ResultFolder
from sarsim.arenas.fiducials import hang_fiducials
from sarsim.arenas.load import load_arena
from sarsim.methods.make import make_exploration, make_localisation, make_planner
from sarsim.methods.perception import make_perception, make_readers
from sarsim.recording import EpisodeRecorder
from sarsim.robots.skid_steered import WHEELS
from sarsim.scoring.episode import EpisodeScore
from sarsim.scoring.missions import mission_score
from sarsim.settings import EpisodeConfig
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig


class Episode(Expedition):
    """An expedition in a simulated arena, and its score.

    Attributes:
        config: its settings.
        robot: in the arena.
        score: by ground truth.
        recorder: writes the Rerun recording.
    """

    def __init__(self, config: EpisodeConfig, brief: MissionBrief | None = None):
        """Explore, or play a mission; raises InputError if the arena, the folder or the viewer is not available."""
        if config.steps < 1 or config.seed < 0:
            raise InputError(f"--steps {config.steps} --seed {config.seed}: at least 1 step, and no negative seed")
        if not np.isfinite(config.goals).all():
            raise InputError(f"--goals {' '.join(f'{x:g} {y:g}' for x, y in config.goals)}: no place is there")
        check_folder(config.folder)
        classifier, detector = make_perception(config)
        arena = load_arena(config.arena, config.start, config.random)
        fiducials = hang_fiducials(arena, config.fiducials, config.seed)
        simulation = SimulationConfig(
            config.odometry,
            config.sensor,
            config.lighting,
            config.dust,
            config.speed,
            config.robot,
            config.tyre_error,
        )
        self.config, self.robot = config, SimulatedRobot(arena, simulation, config.seed)
        model, voxel_size, graph, seed = self.robot.model, config.voxel_size, config.graph, config.seed
        localisation = make_localisation(config.localisation, model, config.odometry == "truth")
        exploration, planner = make_exploration(config.exploration, model, seed), make_planner(config.planner, model)
        readers = make_readers(config)
        mapper = Mapper(model, classifier, detector, voxel_size, graph, seed, localisation, readers)
        with ExitStack() as refused:
            refused.callback(self.robot.close)
            if config.map:
                load_keyframes(config.map / KEYFRAMES, mapper)
            robot, recordings = self._recorded(mapper)
            viewer = None if config.view == "none" else Viewer(config.view)
            make_folder(config.folder)
            self.recorder = EpisodeRecorder(self.robot, config.folder / "episode.rrd", viewer)
            refused.pop_all()
        explorer = Explorer(robot, mapper, exploration, planner)
        self.score = EpisodeScore(self.robot, explorer, fiducials, config.oracle)
        explorer.observers += [self.score, *recordings]
        results = ResultFolder(config, config.folder, config.arena, config.seed, mapper, self.recorder, brief)
        super().__init__(explorer, results, self.score.trajectory, config.steps, config.goals, config.home)

    def _recorded(self, mapper: Mapper) -> tuple[Robot, list[Observer]]:
        """The robot, wrapped so that what it senses and does is recorded, and the wanted bag and TUM sequence."""
        config, robot = self.config, self.robot
        recorded: Robot = robot
        recordings: list[Observer] = []

        def T_world_base() -> NDArray[np.float64]:
            return robot.trajectory[-1].T_world_base

        if config.bag:
            bag = ExplorerBag(
                config.bag,
                config.bag_images,
                recorded,
                mapper,
                T_world_base,
                joints=lambda: Joints(WHEELS, *robot.wheels),
            )
            recorded = bag.robot
            recordings.append(bag)
        if config.tum:
            from sarsim.dataset.exports.tum import TumDrive  # imports HDF5, which episodes do not need otherwise

            tum = TumDrive(config.tum, config.seed)
            recorded = RecordedRobot(recorded, tum, T_world_base=T_world_base)
            recordings.append(tum)
        return recorded, recordings

    @property
    def explored(self) -> str:
        """How much is explored, as text."""
        return f"{self.score.coverage.fraction:.0%} explored"

    def _time(self) -> float:
        return self.robot.time

    def _stages(self) -> dict[str, Any]:
        brief = self.results.brief
        return self.score.report() | (mission_score(self.config.folder, self.robot, brief) if brief else {})

    def _finish(self, sim_time: float, wall_time: float) -> None:
        each(lambda: super(Episode, self)._finish(sim_time, wall_time), self.robot.close)
