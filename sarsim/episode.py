"""An episode: a simulated run, and its score."""

import shutil
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

from pipeline.arrays import Pose
from pipeline.datasets.recorded_robot import Joints, RecordedRobot
from pipeline.errors import InputError
from pipeline.explorer import Explorer
from pipeline.files import check_folder, run_all
from pipeline.mapper import Mapper
from pipeline.plugins.league.brief import MissionBrief
from pipeline.plugins.ros.explorer_bag import ExplorerBag
from pipeline.progress import Progress
from pipeline.robot import Robot
from pipeline.run import ExplorerRun
from pipeline.sink import Sink
from sarsim.arenas.fiducials import hang_fiducials
from sarsim.composition import compose, make_mapper
from sarsim.methods.arena import make_arena
from sarsim.methods.make import make_exploration, make_localisation, make_planner
from sarsim.progress import shown_run
from sarsim.recording import EpisodeRecorder
from sarsim.robots.skid_steered import WHEELS
from sarsim.scoring.episode import EpisodeScore
from sarsim.scoring.missions import MissionScore
from sarsim.settings import EpisodeConfig
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig


class Episode(ExplorerRun):
    """A run in a simulated arena, and its score.

    Attributes:
        config: settings of the episode.
        robot: the robot in the arena.
        score: score by ground truth.
        recorder: writes the Rerun recording.
    """

    def __init__(self, config: EpisodeConfig, brief: MissionBrief | None = None):
        """``brief``: a mission to run; None to explore.

        Raises:
            InputError: the arena, the folder or the viewer is not available.
        """
        if config.seed < 0:
            raise InputError(f"--seed {config.seed}: must not be negative")
        config = replace(config, out=config.folder)
        check_folder(config.folder, config.continues)
        arena = make_arena(config.arena, config.start, config.random, config.seed, config.world_victims)
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
        with ExitStack() as refused:
            refused.callback(self.robot.close)
            mapper = self._mapper()
            model, seed = self.robot.model, config.seed
            planner = make_planner(config.planner, model)
            strategy = make_exploration(config.exploration, model, seed, config.pipeline.exploration)
            robot, recordings = self._recorded(mapper, refused)
            explorer = Explorer(robot, mapper, strategy, planner)
            self.score = EpisodeScore(self.robot, explorer, fiducials, config.oracle)
            judge = [MissionScore(self.robot, brief)] if brief else []
            recorder, others = partial(EpisodeRecorder, self.robot), [self.score, *recordings, *judge]
            about = config.arena, seed, config.view, recorder, others, brief
            parts = compose(config, mapper, config.folder, *about, config.continues)
            refused.pop_all()
        super().__init__(explorer, parts, self.score.trajectory, config.most_steps, config.goals, config.home)

    def _mapper(self) -> Mapper:
        config, model = self.config, self.robot.model
        numbers, is_true = config.pipeline.localisation, config.odometry == "truth"
        localisation = make_localisation(config.localisation, model, numbers, is_true)
        return make_mapper(config, model, config.seed, localisation, config.map, config.graph)

    def _recorded(self, mapper: Mapper, refused: ExitStack) -> tuple[Robot, list[Sink]]:
        """The robot, wrapped to record what it senses and does, and the sinks of the requested bag and TUM sequence.

        The files that they have started are removed if the episode is ``refused``.
        """
        config, robot = self.config, self.robot
        recorded: Robot = robot
        recordings: list[Sink] = []

        def T_world_base() -> Pose:
            return robot.trajectory[-1].T_world_base

        if config.bag:
            bag = ExplorerBag(
                config.bag,
                config.bag_images,
                recorded,
                mapper,
                T_world_base,
                joints=lambda: Joints(WHEELS, *robot.wheels),
                config=config.io.ros,
            )
            refused.callback(shutil.rmtree, config.bag)
            refused.enter_context(bag)
            recorded = bag.robot
            recordings.append(bag)
        if config.tum:
            from sarsim.dataset.exports.tum import TumDrive  # imports HDF5, which episodes do not need otherwise

            tum = refused.enter_context(TumDrive(config.tum, config.seed))
            recorded = RecordedRobot(recorded, tum, T_world_base=T_world_base)
            recordings.append(tum)
        return recorded, recordings

    @property
    def explored(self) -> str:
        """The true explored share, as text."""
        return f"{self._explored_share():.0%} of the drivable ground seen"

    def _explored_share(self) -> float:
        return self.score.explored_so_far

    def run(
        self,
        interrupted: Callable[[], bool] = lambda: False,
        on_progress: Callable[[Progress], object] | None = None,
        show_progress: bool = True,
    ) -> bool:
        """See :meth:`pipeline.run.ExplorerRun.run`.

        Args:
            interrupted: called before each step; the run ends if it returns True.
            on_progress: receives the progress; by default it is shown in a terminal.
            show_progress: whether to show the progress in a terminal if ``on_progress`` is None.
        """
        if on_progress is None and show_progress and sys.stderr.isatty():
            with shown_run(self.config.arena) as show:
                return super().run(interrupted, show)
        return super().run(interrupted, on_progress or (lambda progress: None))

    def _time(self) -> float:
        return self.robot.time

    def _finish(self, sim_time: float) -> None:
        run_all(lambda: super(Episode, self)._finish(sim_time), self.robot.close)
