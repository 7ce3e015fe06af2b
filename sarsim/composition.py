"""Assembly of every run from its settings, whether the robot is simulated, recorded, driven by hand or real."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from pipeline.explorer import Explorer
from pipeline.files import make_folder
from pipeline.localisation.localisation import Localisation
from pipeline.map_file import KEYFRAMES, load_keyframes
from pipeline.mapper import Mapper
from pipeline.plugin import Plugin, RunContext
from pipeline.rerun.recorder import Recorder
from pipeline.rerun.viewer import Viewer
from pipeline.rescue_report.report import RescueReport
from pipeline.results import result_sinks
from pipeline.robot import RobotModel
from pipeline.run import RunParts
from pipeline.sensor import XTION, SensorModel
from pipeline.sink import Sink
from sarsim.methods.make import make_own
from sarsim.methods.perception import make_perception, make_readers
from sarsim.settings import PerceptionConfig, SinkConfig

TRUE_LABELS = PerceptionConfig(labels="truth", detector=None)
"""Labels from the simulator, and no search for people or other finds."""


def make_mapper(
    perception: PerceptionConfig,
    robot: RobotModel,
    seed: int = 0,
    localisation: Localisation | None = None,
    earlier: Path | None = None,
    graph: Literal["mst", "roadmap"] = "roadmap",
    plugins: Sequence[Plugin] = (),
    sensor: SensorModel = XTION,
) -> Mapper:
    """Make the mapper, which holds all maps of a robot.

    Args:
        perception: how to label points and find people, and the parameters of all pipeline packages.
        robot: model of the robot, which determines the traversable ground.
        seed: seed of all random numbers.
        localisation: localisation method; by default SLAM.
        earlier: folder of an earlier run whose map is continued; None to start with empty maps.
        graph: graph used for planning.
        plugins: plug-ins, which may add readers of images.
        sensor: the robot's camera. The metric map uses its maximum range, unless a settings file sets this range.

    Raises:
        InputError: the labels, the detector or the earlier map are not available.
    """
    classifier, detector = make_perception(perception)
    readers, config = make_readers(perception, plugins), perception.pipeline
    if config.metric_map.max_range == XTION.farthest != sensor.farthest:
        config = replace(config, metric_map=replace(config.metric_map, max_range=sensor.farthest))
    mapper = Mapper(robot, classifier, detector, graph, seed, localisation, readers, config)
    if earlier is not None:
        load_keyframes(earlier / KEYFRAMES, mapper)
    return mapper


def compose(
    settings: SinkConfig,
    mapper: Mapper,
    folder: Path,
    place: str,
    seed: int = 0,
    view: Literal["none", "spawn", "web"] = "none",
    recorder: Callable[..., Recorder] = Recorder,
    others: Sequence[Sink] = (),
    plugins: Sequence[Plugin] = (),
    explorer: Explorer | None = None,
    world: Any = None,
    marks: Collection[str] = (),
) -> RunParts:
    """Make the parts of a run.

    The folder for results is made after the user's sinks and the viewer, so that a refused run leaves no folder.

    Args:
        settings: settings of the command, for report.json; they name the user's sinks, which receive the result last.
        mapper: holds all maps.
        folder: folder for the results.
        place: name of the place that is mapped.
        seed: seed of all random numbers.
        view: ``spawn`` or ``web`` to show the growing recording in a window or in the browser, or ``none``.
        recorder: function that makes the Rerun recorder from a file's path, a viewer and ``config``.
        others: further sinks, such as scores and bags.
        plugins: the plug-ins of the run.
        explorer: the explorer that drives the robot; None if there is none.
        world: the :class:`sarsim.simulated_robot.SimulatedRobot`; None if the robot is not simulated.
        marks: names of files; the folder must contain one of them unless it is new or empty.

    Raises:
        InputError: one of the user's sinks, the viewer or the folder is not available.
    """
    own = [make_own("sink", name, Sink) for name in settings.sink]
    viewer = Viewer(view) if view != "none" else None
    make_folder(folder, marks)
    recording = recorder(folder / "episode.rrd", viewer, config=settings.io.rerun)
    rescue_report = RescueReport(recording, config=settings.io.rescue_report)
    context = RunContext(mapper, recording, explorer, world, plugins, folder)
    added = [sink for plugin in plugins for sink in plugin.sinks(context)]
    sinks = result_sinks(settings, place, seed, recording, rescue_report, [*others, *added])
    return RunParts(mapper, folder, place, recording, rescue_report, [*sinks, *own], plugins)
