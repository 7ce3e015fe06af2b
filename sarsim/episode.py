"""An episode: a simulated run, and its score."""

import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from pipeline.datasets.recorded_robot import ReportingRobot
from pipeline.errors import InputError, required
from pipeline.explorer import Explorer
from pipeline.files import check_folder, run_all
from pipeline.localisation.localisation import Localisation
from pipeline.localisation.trajectory import EstimatedTrajectory
from pipeline.mapper import Keyframe, Mapper
from pipeline.plugin import Plugin
from pipeline.progress import Progress
from pipeline.robot import Robot
from pipeline.run import ExplorerRun
from pipeline.sink import Sink
from sarsim.composition import compose, make_mapper
from sarsim.methods.arena import make_arena
from sarsim.methods.make import make_exploration, make_localisation, make_planner
from sarsim.methods.plugins import make_plugins
from sarsim.progress import shown_run
from sarsim.recording import EpisodeRecorder
from sarsim.robots.pose import TrajectorySample
from sarsim.scoring.episode import EpisodeScore
from sarsim.settings import EpisodeConfig
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig


class _TrajectorySink(Sink):
    """Keeps the estimated trajectory of an episode without scores."""

    def __init__(self, localisation: Localisation, poses: Sequence[TrajectorySample]):
        self.trajectory = EstimatedTrajectory(localisation, poses)

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """Add the newest keyframe."""
        self.trajectory.add()


class Episode(ExplorerRun):
    """A run in a simulated arena, and its score.

    Attributes:
        config: settings of the episode.
        robot: the robot in the arena.
        recorder: writes the Rerun recording.
    """

    def __init__(self, config: EpisodeConfig):
        """Make the episode's parts; InputError if the arena, the folder, the viewer or a plug-in is not available."""
        if config.seed < 0:
            raise InputError(f"--seed {config.seed}: must not be negative")
        if config.oracle and not config.scores:
            raise InputError("--oracle: compares scores; leave out --no-scores")
        is_named, config = bool(config.out or config.resume), replace(config, out=config.folder)
        check_folder(config.folder, config.marks)
        plugins = make_plugins(config)
        config = replace(config, plugins={plugin.name: plugin.settings for plugin in plugins})
        arena = make_arena(config.arena, config.start, config.random, config.seed, config.world_victims)
        for plugin in plugins:
            plugin.add_to_arena(arena)
        simulation = SimulationConfig(
            config.odometry,
            config.sensor,
            config.lighting,
            config.dust,
            config.speed,
            config.robot,
            config.tyre_error,
            config.camera_size,
        )
        self.config, self.robot = config, SimulatedRobot(arena, simulation, config.seed)
        with ExitStack() as refused:
            refused.callback(self.robot.close)
            mapper = self._make_mapper(plugins)
            model, seed = self.robot.model, config.seed
            planner = make_planner(config.planner, model)
            strategy = make_exploration(config.exploration, model, seed, config.pipeline.exploration)
            robot, recordings = self._wrapped_robot(mapper, plugins, refused)
            explorer = Explorer(robot, mapper, strategy, planner)
            self._score = EpisodeScore(self.robot, explorer, config.oracle) if config.scores else None
            estimate = _TrajectorySink(mapper.localisation, self.robot.trajectory)
            if not is_named:
                self.config = config = _with_new_folder(config)
                refused.callback(_remove_if_empty, config.folder)
            parts = compose(
                config,
                mapper,
                config.folder,
                config.arena,
                seed,
                config.view,
                recorder=partial(EpisodeRecorder, self.robot),
                others=[self._score or estimate, *recordings],
                plugins=plugins,
                explorer=explorer,
                world=self.robot,
                marks=config.marks,
            )
            refused.pop_all()
        trajectory = self._score.trajectory if self._score else estimate.trajectory
        super().__init__(explorer, parts, trajectory, config.max_steps, config.goals, config.home)

    def _make_mapper(self, plugins: Sequence[Plugin]) -> Mapper:
        config, model = self.config, self.robot.model
        numbers, is_true = config.pipeline.localisation, config.odometry == "truth"
        localisation = make_localisation(config.localisation, model, numbers, is_true)
        sensor = self.robot.sensor
        return make_mapper(config, model, config.seed, localisation, config.map, config.graph, plugins, sensor)

    def _wrapped_robot(
        self, mapper: Mapper, plugins: Sequence[Plugin], refused: ExitStack
    ) -> tuple[Robot, list[Sink]]:
        """The robot, wrapped by the plug-ins and any TUM recorder, and a list with this recorder, if there is one.

        The files that the plug-ins and the recorder have started are removed if the episode is ``refused``.
        """
        config, robot = self.config, self.robot
        recorded: Robot = robot
        recordings: list[Sink] = []

        for plugin in plugins:
            refused.callback(plugin.abandon)
            recorded = plugin.wrap(recorded, robot, mapper)
        if config.tum:
            from sarsim.dataset.exports.tum import TumDrive  # imports HDF5, which episodes do not need otherwise

            tum = refused.enter_context(TumDrive(config.tum, config.seed))
            recorded = ReportingRobot(recorded, tum, T_world_base=lambda: robot.trajectory[-1].T_world_base)
            recordings.append(tum)
        return recorded, recordings

    @property
    def score(self) -> EpisodeScore:
        """The score against the ground truth; RuntimeError if the settings disable scores."""
        return required(self._score)

    @property
    def explored_text(self) -> str:
        """The true explored fraction so far, or the mapped area if there are no scores, as text."""
        return f"{self._score.explored_so_far:.0%} of the drivable ground seen" if self._score else self.mapped_text

    def _explored_fraction(self) -> float | None:
        return self._score.explored_so_far if self._score else None

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


def _with_new_folder(config: EpisodeConfig) -> EpisodeConfig:
    """Create a new default folder for the results, which no other command uses, and return the settings with it."""
    while True:
        config = replace(config, out=replace(config, out=None).folder)
        with suppress(FileExistsError):
            config.folder.mkdir(parents=True)
            return config


def _remove_if_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()
