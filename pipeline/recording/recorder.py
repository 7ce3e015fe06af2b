"""What the robot's software knows, logged to Rerun step by step."""

import subprocess
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from subprocess import DEVNULL
from typing import Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.explorer import Explorer, Step
from pipeline.recording import drawings, victim_drawings
from pipeline.recording.blueprint import blueprint
from pipeline.recording.viewer import Viewer, executable
from pipeline.transforms import tilt_of
from pipeline.victims.victim_map import Victims

Level = Literal["INFO", "WARN", "ERROR"]

FLUSH_TIME = 30.0
"""s, that a sink may take for what is still on its way at the end."""


@dataclass(frozen=True)
class RecordingConfig:
    """How a recording is kept small.

    Attributes:
        jpeg_quality: of the colour images, up to 100.
        max_depth: m, where the colours of the depth images end.
        point_spacing: m; the semantic map is thinned to a point per cube of this side.
        growth: clouds are logged again when they have grown by this share, and at the end.
        motion_period: s, between two logged poses of the moving robot.
        track_spacing: m, between two points of the trajectory.
    """

    jpeg_quality: int = 80
    max_depth: float = 3.5
    point_spacing: float = 0.04
    growth: float = 0.05
    motion_period: float = 0.2
    track_spacing: float = 0.05


class Track:
    """The way driven so far.

    Attributes:
        distance: m.
        positions: (3,) m each, no two neighbours nearer than ``spacing``.
    """

    def __init__(self, spacing: float):
        self.spacing = spacing
        self.distance = 0.0
        self.positions: list[NDArray[np.float64]] = []
        self._last: NDArray[np.float64] | None = None

    def add(self, position: NDArray[np.float64]) -> None:
        """Go on to ``position`` (3,) m."""
        if self._last is not None:
            self.distance += float(np.linalg.norm(position - self._last))
        self._last = position.copy()
        if not self.positions or np.linalg.norm(position - self.positions[-1]) >= self.spacing:
            self.positions.append(self._last)


class Recorder:
    """Logs what the robot's software knows to a file, and to a viewer if there is one.

    Attributes:
        stream: for whoever knows more, such as a simulator; its timelines are ``step`` and ``sim_time``.
    """

    def __init__(
        self,
        path: Path,
        viewer: Viewer | None = None,
        layout: rrb.Blueprint | None = None,
        config: RecordingConfig | None = None,
    ):
        """Begin a recording that bears its folder's name.

        Args:
            path: of the file, which is written as the recording grows and can be read at any time.
            viewer: shows it meanwhile.
            layout: that a viewer opens it with.
            config: how it is kept small.

        Raises:
            InputError: the file cannot be written.
        """
        self.config = config or RecordingConfig()
        self._path, self._viewer = path, viewer
        self.stream = _new_stream(path, viewer)
        self._step = 0
        self._time = 0.0
        self._track = Track(self.config.track_spacing)
        self._moved: tuple[float, float] | None = None
        self._logged_size: dict[str, int] = {}
        self._explorer: Explorer | None = None
        self.stream.send_blueprint(layout or blueprint())
        self.stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, drawings.annotations(), static=True)

    def log_step(self, number: int, explorer: Explorer, step: Step) -> None:
        """Log what a look brought and what has become of the maps."""
        self._step, self._explorer = number, explorer
        self._track.add(step.T_map_base[:3, 3])
        self._set_time(step.frame.time)
        self._log_pose(step.T_map_base)
        self._log_camera(step)
        self._log_maps(explorer)
        self._log_clouds(explorer)
        if explorer.detector is not None:
            self._log_victims(explorer.victims, step)
        log = self.stream.log
        log("world/path_plan", drawings.path(step.T_map_base, step.plan, step.viewpoint))
        log("world/frontiers", drawings.frontier_points(explorer.exploration.frontiers))
        log("world/trajectory", drawings.trajectory(self._track.positions, drawings.TRAJECTORY_COLOUR))
        self._log_metrics(explorer)

    def log_motion(self, time: float, T_map_base: NDArray[np.float64]) -> bool:
        """Log where the robot is between looks, thinned to a few poses a second; whether this one was logged."""
        self._track.add(T_map_base[:3, 3])
        # Half a millisecond, for times that are sums of many control periods.
        if self._moved is not None and time - self._moved[0] < self.config.motion_period - 5e-4:
            return False
        self._set_time(time, on_a_step=False)
        self._log_pose(T_map_base)
        self._log_speed(time)
        return True

    def log_message(self, level: Level, text: str) -> None:
        """Log a line for people to read."""
        self._set_time(self._time)
        self.stream.log("log", rr.TextLog(text, level=level))

    def log_ways(self, ways: Sequence[NDArray[np.float64]]) -> None:
        """Log the ways, (N, 3) points each, from the entrance to the victims."""
        self._set_time(self._time)
        self.stream.log("world/victims/ways", victim_drawings.ways(ways))

    def close(self) -> None:
        """Log the maps as they are at the end, and write what is still on its way to the sinks."""
        if self._explorer is not None:
            self._set_time(self._time)
            self._logged_size.clear()
            self._log_clouds(self._explorer)
        # A window that was closed meanwhile takes nothing more; the file is whole all the same.
        with suppress(RuntimeError) if self._viewer else nullcontext():
            self.stream.flush(timeout_sec=FLUSH_TIME)
        self.stream.disconnect()
        _compact(self._path)

    def _set_time(self, time: float, *, on_a_step: bool = True) -> None:
        """Between two looks there is no step: on that timeline the robot stands where it looked from."""
        self._time = time
        self.stream.set_time("sim_time", duration=time)
        if on_a_step:
            self.stream.set_time("step", sequence=self._step)
        else:
            self.stream.disable_timeline("step")

    def _log_pose(self, T_map_base: NDArray[np.float64]) -> None:
        self.stream.log("world/robot", drawings.transform(T_map_base))
        roll, pitch = np.rad2deg(tilt_of(T_map_base))
        self._log_metric("roll_deg", roll)
        self._log_metric("pitch_deg", pitch)
        self._log_metric("distance_m", self._track.distance)

    def _log_speed(self, time: float) -> None:
        if self._moved is not None:
            before, distance = self._moved
            self._log_metric("speed_m_s", (self._track.distance - distance) / (time - before))
        self._moved = (time, self._track.distance)

    def _log_camera(self, step: Step) -> None:
        frame, camera = step.frame, "world/robot/camera"
        log = self.stream.log
        log(camera, drawings.transform(frame.T_base_camera), drawings.pinhole(frame))
        log(f"{camera}/rgb", drawings.colour_image(frame.rgb, self.config.jpeg_quality))
        log(f"{camera}/depth", drawings.depth_image(frame.depth, self.config.max_depth))
        log(f"{camera}/labels", drawings.label_image(frame, step.labels))

    def _log_victims(self, victims: Victims, step: Step) -> None:
        log = self.stream.log
        log("world/robot/camera/victims", victim_drawings.detections(step.detections, victims.refusals))
        log("world/victims", victim_drawings.boxes(victims))
        log("world/victims/certainty", victim_drawings.certainty(victims))
        log("world/victims/photos", victim_drawings.photo_sheet(victims, self.config.jpeg_quality))
        self._log_metric("victims/confirmed", len(victims.confirmed))
        self._log_metric("victims/unconfirmed", len(victims.unconfirmed))

    def _log_maps(self, explorer: Explorer) -> None:
        log, topology = self.stream.log, explorer.topological_map
        log("world/segments", drawings.segment_boxes(explorer.segments))
        log("world/topological_map/nodes", drawings.nodes(topology))
        log("world/topological_map/edges", drawings.edges(topology))

    def _log_clouds(self, explorer: Explorer) -> None:
        """Log the maps that grow, if they have changed enough."""
        metric_map, semantic_map = explorer.metric_map, explorer.semantic_map
        occupied, free = metric_map.occupied_centres(), metric_map.free_centres()
        growth, spacing = self.config.growth, self.config.point_spacing
        if self._has_changed("occupied", len(occupied), 0.0):
            self.stream.log("world/metric_map/occupied", drawings.occupied_voxels(metric_map, occupied))
        if self._has_changed("free", len(free), growth):
            self.stream.log("world/metric_map/free", drawings.free_voxels(metric_map, free))
        if self._has_changed("semantic", len(semantic_map), growth):
            self.stream.log("world/semantic_map", drawings.labelled_points(semantic_map, spacing))
        self._log_metric("map/occupied_voxels", len(occupied))
        self._log_metric("map/free_voxels", len(free))
        self._log_metric("map/semantic_points", len(semantic_map))

    def _has_changed(self, cloud: str, size: int, growth: float) -> bool:
        """Whether the size differs by more than a share of what was logged last; then it counts as logged."""
        before = self._logged_size.get(cloud, -1)
        if abs(size - before) <= growth * before:
            return False
        self._logged_size[cloud] = size
        return True

    def _log_metrics(self, explorer: Explorer) -> None:
        traversability = explorer.elevation_map
        seen = np.count_nonzero(~np.isnan(traversability.measured))
        self._log_metric("explored_area_m2", seen * traversability.grid.cell**2)
        self._log_metric("map/segments", len(explorer.segments))
        self._log_metric("map/nodes", len(explorer.topological_map.nodes))
        self._log_metric("map/frontiers", len(explorer.exploration.frontiers))
        for stage, seconds in explorer.stopwatch.seconds.items():
            self._log_metric(f"time_ms/{stage}", 1000 * seconds[-1])

    def _log_metric(self, name: str, value: float) -> None:
        self.stream.log(f"metrics/{name}", rr.Scalars(float(value)))


def _compact(path: Path) -> None:
    """Join the many small chunks that a recording is written in: a browser loads it ten times as fast."""
    compacted = path.with_name(path.name + ".partial")
    command: list[str | Path] = [executable(), "rrd", "optimize", path, "-o", compacted]
    # Out of reach of Ctrl-C, which may be what ended the recording.
    done = subprocess.run(command, stdin=DEVNULL, stdout=DEVNULL, stderr=DEVNULL, start_new_session=True)
    if done.returncode == 0:
        compacted.replace(path)
    else:
        compacted.unlink(missing_ok=True)


def _new_stream(path: Path, viewer: Viewer | None) -> rr.RecordingStream:
    stream = rr.RecordingStream("sarsim")
    try:
        stream.set_sinks(rr.FileSink(path), *([viewer.sink] if viewer else []))
    except RuntimeError as error:
        raise InputError(f"{path}: cannot be written ({error})") from error
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.send_recording_name(path.absolute().parent.name)
    return stream
