"""The interface of a plug-in: its hooks, in the order in which a run calls them.

A package registers a plug-in, a subclass of :class:`Plugin`, as an entry point in one of the groups
``sarsim.reader``, ``sarsim.sensor``, ``sarsim.sink`` and ``sarsim.mission``. A run requests a plug-in by its name,
with ``--NAME`` or ``--mission NAME``, and imports it only then. The parts of sarsim outside its core are registered
in the same way.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from pipeline.explorer import Explorer
from pipeline.mapper import Mapper
from pipeline.rerun.recorder import Recorder
from pipeline.robot import Robot
from pipeline.sink import Sink, Step
from pipeline.victims.readers import FindReader


@dataclass(frozen=True)
class NoSettings:
    """Empty settings, for a plug-in without settings."""


@dataclass(frozen=True, eq=False)
class RunContext:
    """The parts of a run that a plug-in's sinks may watch.

    Attributes:
        mapper: holds all maps.
        recorder: writes the Rerun recording, if there is one; its ``stream`` accepts a plug-in's own entities.
        explorer: drives the robot; None if the run does not drive.
        world: the simulated robot, which knows the ground truth; None outside a simulation.
        plugins: all plug-ins of the run.
        folder: where sinks write their files; None if the run writes none.
    """

    mapper: Mapper
    recorder: Recorder | None
    explorer: Explorer | None
    world: Any
    plugins: Sequence["Plugin"]
    folder: Path | None = None


class Plugin:
    """A plug-in of one run; a subclass overrides the hooks that it needs.

    Attributes:
        Settings: a frozen dataclass of its settings, which a run writes under ``plugins.<name>`` of its config.yaml.
            Its fields are flags: a positional field follows ``--<name>``, and other fields are ``--<name>-<field>``.
            Fields marked ``tyro.conf.Fixed`` can only be set in a ``--config`` file, and paths only by a flag.
        needs: names of other plug-ins that this plug-in requires.
        name: the name under which the plug-in's settings are stored.
        settings: an instance of ``Settings``.
        command: the settings of the command, such as :class:`sarsim.settings.EpisodeConfig`.
    """

    Settings: ClassVar[type] = NoSettings
    needs: ClassVar[tuple[str, ...]] = ()
    name: str = ""

    def __init__(self, settings: Any, command: Any) -> None:
        """Check the settings before anything else is created; raise InputError if they are invalid."""
        self.settings, self.command = settings, command

    def add_to_arena(self, arena: Any) -> None:
        """Add to a simulated arena, a :class:`sarsim.arenas.arena.RescueArena`, before the robot is put into it."""

    def readers(self) -> Sequence[FindReader]:
        """Further readers of the camera's frames."""
        return ()

    def wrap(self, robot: Robot, world: Any, mapper: Mapper | None) -> Robot:
        """Return the robot to drive, for example one with another sensor, which measures when the robot is driven.

        ``world``: the simulated robot, as in :class:`RunContext`. ``mapper``: None if nothing is mapped.
        """
        return robot

    def sinks(self, context: RunContext) -> Sequence[Sink]:
        """Sinks, which may write files, log to the recording, and add figures to report.json."""
        return ()

    def abandon(self) -> None:
        """Undo whatever the plug-in has started, because the run is refused."""

    def begin(self, explorer: Explorer, time: float) -> None:
        """Called before the robot's first step, at ``time`` s by its clock, for example to set a deadline."""

    def messages(self, mapper: Mapper, step: Step) -> Iterable[tuple[str, Any]]:
        """Topics and ROS messages to send after a step, to a bag or to a network."""
        return ()

    def measurements(self) -> Iterable[tuple[str, float, Any]]:
        """Topics, times in s, and ROS messages of the plug-in's measurements since the last call.

        Called after every control period, if there is a bag or a network to send them to.
        """
        return ()

    def scene(self, world: Any, folder: Path, index: int) -> AbstractContextManager[Callable[[Any], object]]:
        """Write the plug-in's own files for scene ``index`` of a dataset, next to the scene's file.

        The context yields a function, which is called with the :class:`sarsim.robots.pose.TrajectorySample` of each
        frame when the robot stands at its pose. When the context is left, the files are complete; after an error, no
        files remain.

        Args:
            world: the :class:`sarsim.dataset.render.World`.
            folder: folder of the dataset.
            index: number of the scene.
        """
        return nullcontext(lambda pose: None)

    def dataset(self, folder: Path, splits: Mapping[int, str]) -> None:
        """Write the plug-in's files for a dataset.

        ``splits``: train, val or test of each complete scene, by number.
        """
