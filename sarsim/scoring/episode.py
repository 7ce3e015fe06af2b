"""The score of an episode, which is written to report.json."""

from bisect import bisect_left
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Places
from pipeline.errors import required
from pipeline.explorer import Explorer
from pipeline.frame import Frame
from pipeline.mapper import Keyframe, Mapper
from pipeline.sink import Result, Sink, Step
from pipeline.transforms import yaw_of
from sarsim.ground_truth.faces import true_faces
from sarsim.ground_truth.meshes import true_scene
from sarsim.scoring.coverage import Coverage
from sarsim.scoring.navigation import NavigationScore, navigation_figures
from sarsim.scoring.oracle import Oracle
from sarsim.scoring.progress import EXPLORED_FRACTIONS, ExploredCurve, progress_figures
from sarsim.scoring.segments import SegmentScore
from sarsim.scoring.semantics import KeyframeTruth, SurfaceScore, map_figures
from sarsim.scoring.sight import Sight
from sarsim.scoring.topology import score_topology
from sarsim.scoring.topology_kernels import shortest_path_length
from sarsim.scoring.trajectory import TrajectoryScore, distance_driven, distances_driven
from sarsim.scoring.victims import VictimScore
from sarsim.scoring.voxels import VoxelScore
from sarsim.simulated_robot import SimulatedRobot, TrueFrame


class EpisodeScore(Sink):
    """Scores an episode against ground truth, in a separate thread while the robot continues to drive.

    Attributes:
        surface: the true ground.
        trajectory: the estimated trajectory and its errors.
    """

    finishing = "scoring against the ground truth"

    def __init__(self, robot: SimulatedRobot, explorer: Explorer, oracle: bool = False):
        """Score a robot, starting at its current pose.

        Args:
            robot: the robot in the arena.
            explorer: the explorer that drives the robot.
            oracle: whether the report compares the robot with the tour of a robot that knows the ground.
        """
        self._robot = robot
        self._explorer = explorer
        model, data = robot.physics.model.ptr, robot.physics.data.ptr
        self._coverage = Coverage(robot)
        self.surface = self._coverage.surface
        self._navigation = NavigationScore(robot, self.surface)
        self._segments = SegmentScore(true_faces(model, data), are_whole=explorer.mapper.keyframes.loaded_count > 0)
        self._voxels = VoxelScore(explorer.mapper.metric_map)
        voxel = explorer.mapper.semantic_map.config.voxel
        self._semantics = KeyframeTruth(explorer.mapper.keyframes, voxel)
        self._surfaces = SurfaceScore(voxel)
        self._victims = VictimScore(model, data)
        self.trajectory = TrajectoryScore(explorer.mapper.localisation, robot.trajectory)
        for seen, T in zip(explorer.mapper.keyframes.observations, explorer.mapper.keyframes.poses, strict=True):
            self._coverage.see(seen.points_at(T))
        self._cost_ratios: list[float] = []
        self._start_time, self._T_world_start = robot.time, robot.trajectory[-1].T_world_base
        # Not after earlier episodes, because their map already shows ground at the start.
        self._wants_oracle = oracle and not explorer.mapper.keyframes.loaded_count
        self._first_frame: Frame | None = None
        self._kidnaps = 0
        self._frontiers_left = 0
        self._progress: list[tuple[float, float]] = []
        self._executor, self._pending = ThreadPoolExecutor(1), list[Future[None]]()

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """Add the newest keyframe to the scores."""
        truth = required(self._robot.true_frame)
        self.trajectory.add()
        if self._wants_oracle and self._first_frame is None:
            self._first_frame = keyframe.frame
        self._pending.append(self._executor.submit(self._compare, keyframe, truth))

    def _compare(self, keyframe: Keyframe, truth: TrueFrame) -> None:
        """Score a keyframe against the noise-free frame of the same moment."""
        points = truth.points()
        self._voxels.add(points, truth.image.T_world_camera[:3, 3])
        self._coverage.see(points)
        self._progress.append((keyframe.frame.time - self._start_time, self._coverage.fraction))
        self._victims.add(truth.image)
        if len(keyframe.labels):  # only labelled keyframes are added to the semantic map and the segments
            self._semantics.add(keyframe)
            self._surfaces.add(points)
            self._segments.add(points, truth.image.instance[truth.image.depth > 0])

    def _wait(self) -> None:
        """Wait until the scores include every keyframe."""
        for comparison in self._pending:
            comparison.result()
        self._pending.clear()

    @property
    def explored_so_far(self) -> float:
        """Fraction of the drivable ground seen in the keyframes compared so far, without waiting for the others."""
        return self._coverage.fraction

    @property
    def coverage(self) -> Coverage:
        """The true ground that noise-free returns, and returns kept from an earlier episode, have shown."""
        self._wait()
        return self._coverage

    @property
    def progress(self) -> ExploredCurve:
        """The explored fraction of the drivable area at each keyframe."""
        self._wait()
        times, shares = np.array(self._progress).reshape(-1, 2).T
        poses = self._robot.trajectory
        ways = np.interp(times, [pose.time - self._start_time for pose in poses], distances_driven(poses))
        return ExploredCurve(times, ways, shares)

    def on_step(self, mapper: Mapper, step: Step) -> None:
        """Add the newest step to the scores."""
        truth = required(self._robot.true_frame)
        self._kidnaps += step.was_carried
        self._frontiers_left = len(step.frontiers)
        if step.plan is not None and step.plan.length > 0.1:
            self._cost_ratios.append(
                step.plan.length / self._shortest_length(truth.T_world_base[:2, 3], step.plan.waypoints[-1, :2])
            )

    def finish(self, result: Result) -> None:
        """Add to the report the figures of all stages that have figures."""
        super().finish(result)
        self._executor.shutdown()

    def figures(self) -> dict[str, Any]:
        """The figures of all stages that have figures, by stage; the commands add the settings and times."""
        self._wait()
        explorer, keyframes = self._explorer, self._explorer.mapper.keyframes
        stages = {
            "metric_map": self._voxels.report(),
            "semantic_map": map_figures(self._semantics.map(), explorer.mapper.semantic_map)
            | ({} if keyframes.loaded_count else self._surfaces.report(explorer.mapper.semantic_map.points())),
            "segments": self._segments.report(explorer.mapper.segments),
            "topological_map": score_topology(explorer.mapper.topological_map, self.surface),
            "path_plan": self._path_plan(),
            "navigation": navigation_figures(explorer.pilot.navigator, self._navigation, self._kidnaps),
            "exploration": self._exploration(),
            "localisation": self.trajectory.report() | {"relocalised": explorer.pilot.pose_check.relocalised},
            **self._goals(),
            **({"victims": self._victims.report(self._confirmed)} if explorer.mapper.detector else {}),
        }
        return {name: stage for name, stage in stages.items() if stage}

    @property
    def position_errors(self) -> list[float]:
        """Position error in m of each victim that was found."""
        errors = self._victims.matches(self._confirmed)
        return errors[np.isfinite(errors)].tolist()

    @property
    def _confirmed(self) -> Places:
        """(N, 3) m, positions of the victims that the robot confirmed."""
        return np.array([victim.position for victim in self._explorer.mapper.victims.confirmed]).reshape(-1, 3)

    def _shortest_length(self, start: NDArray[np.float64], goal: NDArray[np.float64]) -> float:
        """Length in m of the shortest path on the grid of the true ground; NaN if there is none."""
        grid, drivable = self.surface.grid, self.surface.drivable
        first, last = grid.nearest(drivable, start, 0.3), grid.nearest(drivable, goal, 0.3)
        if first is None or last is None:
            return float("nan")
        length = shortest_path_length(*grid.cell_of(first), *grid.cell_of(last), drivable)
        return max(float(length) * grid.cell, grid.cell)

    def _exploration(self) -> dict[str, Any]:
        """The figures of the exploration, without the times of ``EXPLORED_FRACTIONS`` that were not reached."""
        end = self._robot.time - self._start_time, distance_driven(self._robot.trajectory)
        seen = progress_figures(self.progress, end)
        oracle = (
            self._oracle(self._first_frame, seen.get("t99_s")) if self._wants_oracle and self._first_frame else {}
        )
        return {"explored_fraction": self.coverage.fraction, "frontiers_left": self._frontiers_left, **seen, **oracle}

    def _oracle(self, frame: Frame, t99: float | None) -> dict[str, float]:
        """The oracle's figures; empty if no tour sees enough.

        If the robot saw enough, at ``t99`` s, the figures include its ratios to the tour; otherwise ``t99`` is None.
        """
        robot, T = self._robot, self._T_world_start
        scene = true_scene(robot.physics.model.ptr, robot.physics.data.ptr, robot.base_body)
        ground = self._navigation.ground
        start = np.array([*T[:2, 3], yaw_of(T)])
        sight = Sight(self.surface, ground, scene, replace(frame, sensor=robot.noise_free_sensor))
        oracle = Oracle(ground, sight, start, EXPLORED_FRACTIONS["t99_s"], robot.robot.drive)
        figures = oracle.figures()
        if figures and t99 is not None:
            way = distance_driven([pose for pose in robot.trajectory if pose.time - self._start_time <= t99])
            figures |= oracle.ratios(way, t99)
        return figures

    def _goals(self) -> dict[str, Any]:
        """The figures of each goal, with the length of the shortest path on the true ground, if a path exists."""
        tasks, visits = self._explorer.mission.report(), self._explorer.mission.visits
        for name, task in tasks.items():
            for figures, visit in zip(task["each"], visits[name], strict=True):
                is_place = np.isfinite(visit.goal).all()
                shortest = self._shortest_length(self._place_at(visit.begin), visit.goal) if is_place else np.nan
                figures |= {"shortest_m": shortest} if np.isfinite(shortest) else {}
        return {name: {"each": task["each"]} for name, task in tasks.items()}

    def _place_at(self, time: float) -> NDArray[np.float64]:
        """(2,) m, true position of the robot at a time, s."""
        poses = self._robot.trajectory
        at = min(bisect_left(poses, time, key=lambda pose: pose.time), len(poses) - 1)
        return poses[at].T_world_base[:2, 3]

    def _path_plan(self) -> dict[str, Any]:
        ratios = np.array([r for r in self._cost_ratios if np.isfinite(r)])
        cost = {"median": float(np.median(ratios)), "max": float(ratios.max())} if len(ratios) else {}
        return {"plans": len(self._cost_ratios), "cost_vs_grid": cost}
