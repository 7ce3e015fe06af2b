"""A simulated episode in Rerun: the maps and estimates of the robot's software, and the true arena."""

from pathlib import Path

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from pipeline.labels import Label
from pipeline.localisation.localisation import Localisation
from pipeline.mapper import Mapper
from pipeline.rerun import drawings
from pipeline.rerun.blueprint import blueprint
from pipeline.rerun.config import RerunConfig
from pipeline.rerun.recorder import Recorder
from pipeline.rerun.trajectory import DrawnTrajectory
from pipeline.rerun.viewer import Viewer
from pipeline.robot import Motion
from pipeline.sink import Step
from pipeline.transforms import from_rotation, inverse
from sarsim.ground_truth.meshes import Mesh, drawn_geoms, geom_poses, joined_mesh
from sarsim.sensors.camera import geom_labels
from sarsim.simulated_robot import SimulatedRobot


class EpisodeRecorder(Recorder):
    """Logs an episode; the robot is drawn at its estimated pose, the arena at its true pose."""

    def __init__(
        self, robot: SimulatedRobot, path: Path, viewer: Viewer | None = None, *, config: RerunConfig = RerunConfig()
    ):
        """Start the recording with the arena and the robot's shape.

        Args:
            robot: the robot in its arena.
            path: the file, which grows with the recording and can be read at any time.
            viewer: shows the recording while it grows.
            config: how much is logged.

        Raises:
            InputError: the file cannot be written.
        """
        self._robot = robot
        self._model: mujoco.MjModel = robot.physics.model.ptr
        self._data: mujoco.MjData = robot.physics.data.ptr
        base = robot.physics.bind(robot.robot.base).element_id
        self._is_robot = self._model.body_rootid == self._model.body_rootid[base]
        self._geoms = np.flatnonzero(drawn_geoms(self._model))
        has_joint = self._is_robot & (self._model.body_jntnum > 0) & (self._model.body_parentid > 0)
        self._jointed = [(body, self._entity(body)) for body in np.flatnonzero(has_joint).tolist()]
        self._true_track = DrawnTrajectory(config.point_spacing)
        arena = self._arena_meshes()
        vertices = np.concatenate([mesh.vertices for mesh in arena.values()])
        layout = blueprint(vertices.min(axis=0), vertices.max(axis=0))
        super().__init__(path, viewer, layout, config=config)
        for label, mesh in arena.items():
            self.stream.log(f"world/arena/{label.name.lower()}", _mesh3d(mesh), static=True)
        self._log_robot()

    def on_step(self, mapper: Mapper, step: Step) -> None:
        """Log a step of the explorer, and the maps after it."""
        self._true_track.add(self._T_world_base[:3, 3])
        super().on_step(mapper, step)
        self._log_joints()

    def on_motion(self, motion: Motion) -> None:
        """Log the robot's pose after a control period, at most once per ``motion_period``, by default 0.2 s."""
        self._true_track.add(self._T_world_base[:3, 3])
        if self.log_pose(motion.time, motion.T_odom_base):
            self._log_joints()
            self._log_error()

    def log_trajectory(self, localisation: Localisation) -> None:
        """Log the estimated trajectory so far and, if the odometry can err, the true trajectory."""
        super().log_trajectory(localisation)
        if self._can_err:
            way = [*self._true_track.positions, self._T_world_base[:3, 3]]
            self.stream.log("world/trajectory/true", drawings.trajectory(way, drawings.TRUE_TRAJECTORY_COLOUR))
            self._log_error()

    @property
    def _can_err(self) -> bool:
        return self._robot.config.odometry == "wheel"

    @property
    def _T_world_base(self) -> NDArray[np.float64]:
        return self._robot.trajectory[-1].T_world_base

    def _log_error(self) -> None:
        """Log the distance, m, between the robot's true and estimated positions, if the odometry can err."""
        if self._can_err:
            error = np.linalg.norm((self.T_map_base - self._T_world_base)[:3, 3])
            self.stream.log("metrics/position_error_m", rr.Scalars(float(error)))

    def _arena_meshes(self) -> dict[Label, Mesh]:
        """The meshes of the arena in its current state, by label."""
        labels = geom_labels(self._model)
        geoms = self._geoms[~self._is_robot[self._model.geom_bodyid[self._geoms]]]
        meshes = {}
        for label in map(Label, np.unique(labels[geoms])):
            chosen = geoms[labels[geoms] == label]
            poses = [
                from_rotation(self._data.geom_xmat[geom].reshape(3, 3), self._data.geom_xpos[geom]) for geom in chosen
            ]
            meshes[label] = joined_mesh(self._model, chosen, poses)
        return meshes

    def _log_robot(self) -> None:
        """Log one mesh per body of the robot, in the body's frame."""
        for body in np.unique(self._model.geom_bodyid[self._geoms]).tolist():
            if self._is_robot[body]:
                geoms = self._geoms[self._model.geom_bodyid[self._geoms] == body]
                mesh = joined_mesh(self._model, geoms, geom_poses(self._model, geoms))
                entity = self._entity(body)
                self.stream.log(entity, _mesh3d(mesh), static=True)
                if not self._model.body_jntnum[body]:
                    T_base_body = inverse(self._T_world_base) @ self._T_world_body(body)
                    self.stream.log(entity, drawings.transform(T_base_body), static=True)

    def _log_joints(self) -> None:
        """Log the poses, relative to the robot's base, of the bodies with joints."""
        T_base_world = inverse(self._T_world_base)
        for body, entity in self._jointed:
            self.stream.log(entity, drawings.transform(T_base_world @ self._T_world_body(body)))

    def _entity(self, body: int) -> str:
        return "world/robot/" + self._model.body(body).name.rpartition("/")[2]

    def _T_world_body(self, body: int) -> NDArray[np.float64]:
        return from_rotation(self._data.xmat[body].reshape(3, 3), self._data.xpos[body])


def _mesh3d(mesh: Mesh) -> rr.Mesh3D:
    return rr.Mesh3D(
        vertex_positions=mesh.vertices,
        vertex_normals=mesh.normals,
        triangle_indices=mesh.triangles,
        vertex_colors=mesh.colours,
    )
