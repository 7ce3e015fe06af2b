"""Log the state of the robot's software to Rerun, step by step."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from pipeline.arrays import Places, Pose
from pipeline.errors import InputError
from pipeline.keyframes import Moves
from pipeline.localisation.localisation import Localisation
from pipeline.mapper import Keyframe, Mapper
from pipeline.rerun import drawings, find_drawings, victim_drawings
from pipeline.rerun.blueprint import blueprint
from pipeline.rerun.config import RerunConfig
from pipeline.rerun.legend import legend
from pipeline.rerun.trajectory import CorrectedTrajectory
from pipeline.rerun.viewer import Viewer, start_rerun
from pipeline.robot import Motion
from pipeline.sink import Result, Sink, Step
from pipeline.tracks.finds import Finds
from pipeline.transforms import roll_pitch_of
from pipeline.victims.victim_map import Victims

APPLICATION = "sarsim"  # Rerun keeps one layout for each application
MIN_RELATIVE_CHANGE = 0.05
"""Relative change in size above which a cloud is logged again; all clouds are logged at the end."""
PHOTO_SIDE = 240
"""Side of the photo of a person or find, caption included, pixels."""
Level = Literal["INFO", "WARN", "ERROR"]


class Recorder(Sink):
    """Logs the state of the robot's software to a file, and to a viewer if there is one.

    Attributes:
        stream: Rerun's stream, to which other components, such as a simulator, may also log; the stream's timelines
            are ``step`` and ``sim_time``.
        viewer: viewer that shows the recording as it grows; None without a viewer.
    """

    finishing = "writing the recording"

    def __init__(
        self,
        path: Path,
        viewer: Viewer | None = None,
        layout: rrb.Blueprint | None = None,
        *,
        config: RerunConfig = RerunConfig(),
    ):
        """Start a recording named after its folder.

        Args:
            path: path of the file, which grows with the recording and can be read at any time.
            viewer: viewer that shows the recording as it grows.
            layout: layout with which a viewer opens the recording; :func:`blueprint` by default.
            config: parameters of the recording.

        Raises:
            InputError: the file cannot be written.
        """
        self._path, self.viewer, self._config = path, viewer, config
        self.stream = _new_stream(path, viewer)
        self._step = 0
        self._time = 0.0
        self._trajectory = CorrectedTrajectory(config.point_spacing)
        self._T_odom_base = np.eye(4)
        self._logged_runs: dict[str, int] = {}
        self._last_logged: tuple[float, float] | None = None  # Time, s, and distance driven, m
        self._logged_size: dict[str, int] = {}
        self._shifts = np.zeros(0)  # Maximum distance that each keyframe's view has moved since it was drawn, m
        self._mapper: Mapper | None = None
        self.stream.send_blueprint(layout or blueprint())
        self.stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, drawings.annotations(), static=True)
        self.stream.log("legend", rr.Image(legend(), magnification_filter="linear"), static=True)
        self.stream.log("metrics/localisation/correction_m", rr.SeriesPoints(marker_sizes=3), static=True)

    def on_motion(self, motion: Motion) -> None:
        """Log the robot's pose, at most once per ``motion_period``."""
        self.log_pose(motion.time, motion.T_odom_base)

    def on_step(self, mapper: Mapper, step: Step) -> None:
        """Log a step of the explorer, and the maps after this step."""
        self.log_keyframe(step.number, mapper, step.keyframe)
        self.stream.log("world/path_plan", drawings.path(step))
        self.stream.log("world/frontiers", drawings.frontier_points(step.frontiers))
        self._log_metrics("map/", frontiers=len(step.frontiers))

    def log_keyframe(self, index: int, mapper: Mapper, keyframe: Keyframe) -> None:
        """Log the keyframe of the ``index``-th step, and the maps after this step."""
        self._step, self._mapper = index, mapper
        self._move(keyframe.frame.T_odom_base)
        self._set_time(keyframe.frame.time)
        self._log_robot_pose()
        self._log_camera(keyframe)
        self._log_maps(mapper)
        if mapper.detector is not None:
            found = victim_drawings.detections(keyframe.detections, mapper.victims.refusals)
            self.stream.log("world/robot/camera/victims", found)
        if mapper.readers is not None:
            self.stream.log("world/robot/camera/finds", find_drawings.outlines(mapper.finds.readings))
        self._log_progress(mapper)

    def log_pose(self, time: float, T_odom_base: Pose) -> bool:
        """Log the robot's pose between steps, at most once per ``motion_period``; True if the pose was logged.

        Args:
            time: time of the pose, s.
            T_odom_base: pose from the odometry, which is transformed to ``map`` by the newest keyframe's correction.
        """
        self._move(T_odom_base)
        if self._last_logged is not None:
            # Times are sums of many control periods, so rounding errors are removed by rounding to the millisecond.
            passed = time - self._last_logged[0]
            if passed <= 0 or round(passed, 3) < self._config.motion_period:
                return False
        self._set_time(time, on_a_step=False)
        self._log_robot_pose()
        if self._mapper is not None:
            self._log_keyframes(self._mapper.localisation)
        if self._last_logged is not None:
            before, distance = self._last_logged
            self._log_metrics(speed_m_s=(self._trajectory.distance - distance) / (time - before))
        self._last_logged = (time, self._trajectory.distance)
        return True

    def on_correction(self, moves: Moves) -> None:
        """Log a correction of keyframes; if a keyframe has moved visibly, the next step logs all clouds again."""
        self._logged_size.pop("keyframes", None)
        ways, turns = moves.distances, moves.turns
        shifts = np.maximum(ways, turns * moves.reach)
        shifts[: len(self._shifts)] += self._shifts
        self._shifts = shifts
        if shifts.max() > self._config.point_spacing:
            self._logged_size.clear()
            self._shifts = np.zeros(0)
        count = np.count_nonzero(moves.are_noticeable)
        farthest = f"{ways.max():.3f} m and {np.rad2deg(turns.max()):.1f}°"
        moved = f"{count} of {len(ways)} keyframes moved by up to {farthest}; the maps were rebuilt"
        self.log_message("INFO", moved)
        self._log_metrics("localisation/", correction_m=ways.max())
        self._log_robot_pose()

    def log_message(self, level: Level, text: str) -> None:
        """Log a line of text."""
        self._set_time(self._time)
        self.stream.log("log", rr.TextLog(text, level=level))

    def log_routes(self, routes: Sequence[Places]) -> None:
        """Log the paths from the entrance to the victims."""
        self._set_time(self._time)
        self.stream.log("world/victims/ways", victim_drawings.paths(routes))

    def finish(self, result: Result) -> None:
        """Log the final maps, and write all remaining data to the sinks; InputError if the disk is full."""
        self.close()

    def close(self) -> None:
        """Log the final maps, and write all remaining data to the sinks; InputError if the disk is full."""
        if self._mapper is not None:
            self._set_time(self._time)
            self._logged_size.clear()
            self._log_maps(self._mapper)
            self._log_robot_pose()
        try:
            self._flush()
        finally:
            self.stream.disconnect()
        _compact(self._path)

    def _flush(self) -> None:
        try:
            self.stream.flush(timeout_sec=self._config.flush_timeout)
        except RuntimeError as error:
            # A window that was closed in the meantime accepts no more data, but the file is still complete.
            if self.viewer is None:
                raise InputError(f"{self._path}: the recording could not be completed: {error}") from error

    def _set_time(self, time: float, *, on_a_step: bool = True) -> None:
        """Set the time of the next data; on the timeline ``step``, the robot stays at its keyframe between steps."""
        self._time = time
        self.stream.set_time("sim_time", duration=time)
        if on_a_step:
            self.stream.set_time("step", sequence=self._step)
        else:
            self.stream.disable_timeline("step")

    @property
    def T_map_base(self) -> Pose:
        """Current estimate of the robot's pose; before the first step, the odometry's frame serves as ``map``."""
        return self._mapper.T_map_odom @ self._T_odom_base if self._mapper else self._T_odom_base

    def log_trajectory(self, localisation: Localisation) -> None:
        """Log the current estimate of the trajectory driven so far."""
        way = [*self._trajectory.positions(localisation.poses), self.T_map_base[:3, 3]]
        self.stream.log("world/trajectory/estimated", drawings.trajectory(way, drawings.TRAJECTORY_COLOUR))

    def _move(self, T_odom_base: Pose) -> None:
        self._T_odom_base = T_odom_base
        self._trajectory.add(T_odom_base, self._mapper.localisation if self._mapper else None)

    def _log_robot_pose(self) -> None:
        T_map_base = self.T_map_base
        self.stream.log("world/robot", drawings.transform(T_map_base))
        roll, pitch = np.rad2deg(roll_pitch_of(T_map_base))
        self._log_metrics(roll_deg=roll, pitch_deg=pitch, distance_m=self._trajectory.distance)

    def _log_camera(self, keyframe: Keyframe) -> None:
        frame, camera = keyframe.frame, "world/robot/camera"
        log = self.stream.log
        log(camera, drawings.transform(frame.T_base_camera), drawings.pinhole(frame))
        log(f"{camera}/rgb", drawings.colour_image(frame.rgb))
        log(f"{camera}/depth", drawings.depth_image(frame))
        log(f"{camera}/labels", drawings.label_image(frame, keyframe.labels))

    def _log_maps(self, mapper: Mapper) -> None:
        """Log all maps and poses that change when keyframes are corrected."""
        log, localisation = self.stream.log, mapper.localisation
        self._log_clouds(mapper)
        log("world/segments", drawings.segment_boxes(mapper.segments))
        log("world/topological_map/nodes", drawings.nodes(mapper.topological_map))
        log("world/topological_map/edges", drawings.edges(mapper.topological_map))
        if mapper.detector is not None:
            self._log_victims(mapper.victims)
        if mapper.readers is not None:
            self._log_finds(mapper.finds)
        self.log_trajectory(localisation)
        self._log_keyframes(localisation)
        log("world/localisation/loops", drawings.loops(localisation.loops, localisation.poses))
        self._log_metrics("localisation/", keyframes=len(localisation.poses), loops=len(localisation.loops))

    def _log_keyframes(self, localisation: Localisation) -> None:
        if self._has_changed("keyframes", len(localisation.poses), 0.0):
            self.stream.log("world/localisation/keyframes", drawings.keyframes(localisation.poses))

    def _log_victims(self, victims: Victims) -> None:
        log = self.stream.log
        log("world/victims", victim_drawings.boxes(victims))
        log("world/victims/certainty", victim_drawings.confidence_ellipsoids(victims))
        log("world/victims/photos", victim_drawings.photo_sheet(victims, PHOTO_SIDE))
        confirmed, unconfirmed = len(victims.confirmed), len(victims.worth_a_look)
        self._log_metrics("victims/", confirmed=confirmed, unconfirmed=unconfirmed)

    def _log_finds(self, finds: Finds) -> None:
        confirmed = finds.reported
        self.stream.log("world/finds", find_drawings.marks(confirmed))
        self.stream.log("world/finds/photos", find_drawings.photo_sheet(confirmed, PHOTO_SIDE))
        self._log_metrics("finds/", confirmed=len(confirmed), worth_a_look=len(finds.worth_a_look))

    def _log_clouds(self, mapper: Mapper) -> None:
        """Log the metric map and the semantic map, each of them only if its size has changed enough."""
        metric_map, semantic_map = mapper.metric_map, mapper.semantic_map
        occupied, free = metric_map.counts
        if self._has_changed("occupied", occupied, 0.0):
            self.stream.log("world/metric_map/occupied", drawings.occupied_voxels(metric_map))
        if self._has_changed("free", free, MIN_RELATIVE_CHANGE):
            self.stream.log("world/metric_map/free", drawings.free_voxels(metric_map))
        if self._has_changed("semantic", len(semantic_map), MIN_RELATIVE_CHANGE):
            self.stream.log("world/semantic_map", drawings.labelled_points(semantic_map, self._config.point_spacing))
        self._log_metrics("map/", occupied_voxels=occupied, free_voxels=free, semantic_points=len(semantic_map))

    def _has_changed(self, cloud: str, size: int, growth: float) -> bool:
        """Whether a cloud's size has changed by more than the fraction ``growth`` since it was last logged.

        If so, store the new size.
        """
        before = self._logged_size.get(cloud, -1)
        if abs(size - before) <= growth * before:
            return False
        self._logged_size[cloud] = size
        return True

    def _log_progress(self, mapper: Mapper) -> None:
        elevation_map, stopwatch = mapper.elevation_map, mapper.stopwatch
        seen = np.count_nonzero(~np.isnan(elevation_map.measured))
        self._log_metrics(explored_area_m2=seen * elevation_map.grid.cell**2)
        nodes = len(mapper.topological_map.nodes)
        self._log_metrics("map/", segments=len(mapper.segments), nodes=nodes)
        for stage, seconds in stopwatch.seconds.items():
            if len(seconds) > self._logged_runs.get(stage, 0):
                self._log_metrics("time_ms/", **{stage: 1e3 * seconds[-1]})
            self._logged_runs[stage] = len(seconds)

    def _log_metrics(self, group: str = "", /, **values: float) -> None:
        for name, value in values.items():
            self.stream.log(f"metrics/{group}{name}", rr.Scalars(float(value)))


def _compact(path: Path) -> None:
    """Merge the many small chunks of a recording, so that a browser loads it ten times as fast."""
    compacted = path.with_name(path.name + ".partial")
    if start_rerun("rrd", "optimize", path, "-o", compacted).wait() == 0:
        compacted.replace(path)
    else:
        compacted.unlink(missing_ok=True)


def _new_stream(path: Path, viewer: Viewer | None) -> rr.RecordingStream:
    stream = rr.RecordingStream(APPLICATION)
    try:
        stream.set_sinks(rr.FileSink(path), *([viewer.sink] if viewer else []))
    except RuntimeError as error:
        raise InputError(f"{path}: cannot be written: {error}") from error
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.send_recording_name(path.absolute().parent.name)
    return stream
