"""Where every run is put together from its settings, be the robot simulated, recorded, driven by hand or real."""

from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Literal

from pipeline.files import make_folder
from pipeline.league.brief import MissionBrief
from pipeline.localisation.localisation import Localisation
from pipeline.map_file import KEYFRAMES, load_keyframes
from pipeline.mapper import Mapper
from pipeline.rerun.recorder import Recorder
from pipeline.rerun.viewer import Viewer
from pipeline.rescue_report.report import RescueReport
from pipeline.results import result_sinks
from pipeline.robot import RobotModel
from pipeline.run import RunParts
from pipeline.sink import Sink
from sarsim.methods.make import own_sink
from sarsim.methods.perception import make_perception, make_readers
from sarsim.settings import PerceptionConfig, SinkConfig

TRUE_LABELS = PerceptionConfig(labels="truth", detector=None)
"""The simulator's labels; nobody looks for people or finds."""


def make_mapper(
    perception: PerceptionConfig,
    robot: RobotModel,
    seed: int = 0,
    localisation: Localisation | None = None,
    earlier: Path | None = None,
    graph: Literal["mst", "roadmap"] = "roadmap",
) -> Mapper:
    """The maps of a robot.

    Args:
        perception: what labels points and finds people, with the numbers of all rooms.
        robot: decides what is traversable.
        seed: of all random numbers.
        localisation: by default SLAM.
        earlier: folder of an earlier run, in whose map this one goes on; None to begin with empty maps.
        graph: what plans are made on.

    Raises:
        InputError: the labels, the detector or the earlier map are not available.
    """
    classifier, detector = make_perception(perception)
    readers, config = make_readers(perception), perception.pipeline
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
    brief: MissionBrief | None = None,
    continues: Collection[str] = (),
) -> RunParts:
    """The parts of a run that leaves results in a folder, which is made last, so that a refusal leaves none behind.

    Args:
        settings: of the command, for report.json, with the user's own sinks, which take the result last.
        mapper: with all maps.
        folder: for files.
        place: name of the place that is mapped.
        seed: of all random numbers.
        view: ``spawn`` or ``web`` to show the recording while it grows.
        recorder: makes the one that writes the Rerun recording, of a file's path, a viewer and ``config``.
        others: further sinks, such as scores and bags.
        brief: of a mission whose files are handed in.
        continues: names of files, one of which the folder must have unless it is new or empty.

    Raises:
        InputError: a sink of the user's own, the viewer or the folder is not available.
    """
    own = [own_sink(name) for name in settings.sink]
    viewer = Viewer(view) if view != "none" else None
    make_folder(folder, continues)
    recording = recorder(folder / "episode.rrd", viewer, config=settings.io.rerun)
    rescue_report = RescueReport(recording, config=settings.io.rescue_report)
    sinks = result_sinks(settings, place, seed, recording, rescue_report, brief, others)
    return RunParts(mapper, folder, place, recording, rescue_report, [*sinks, *own], brief)
