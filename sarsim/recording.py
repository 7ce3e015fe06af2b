"""A simulated episode in Rerun: what the robot's software knows, and the world that it moves in."""

from collections.abc import Sequence

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from pipeline import drawings
from pipeline.explorer import Explorer, Look
from pipeline.labels import Label
from pipeline.layout import blueprint
from pipeline.recording import Level, Recorder, RecordingConfig, Sink, Track, new_recording
from pipeline.transforms import from_rotation, inverse
from sarsim.camera import geom_labels
from sarsim.meshes import Mesh, drawn_geoms, geom_poses, joined_mesh
from sarsim.simulated_robot import Pose, SimulatedRobot

TRUE_TRACK_COLOUR = (0, 255, 120)


class EpisodeRecorder:
    """Logs an episode; the robot is drawn where its software believes it to be, the arena where it is."""

    def __init__(
        self,
        robot: SimulatedRobot,
        sinks: Sequence[Sink],
        name: str = "episode",
        config: RecordingConfig | None = None,
    ):
        """Log the arena and the robot's shape.

        Args:
            robot: in its arena.
            sinks: where the recording flows.
            name: of the recording in the viewer.
            config: of the pipeline's part.

        Raises:
            InputError: a file cannot be written.
        """
        self._robot = robot
        self._model: mujoco.MjModel = robot.physics.model.ptr
        self._data: mujoco.MjData = robot.physics.data.ptr
        base = robot.physics.bind(robot.robot.base).element_id
        self._is_robot = self._model.body_rootid == self._model.body_rootid[base]
        self._geoms = np.flatnonzero(drawn_geoms(self._model))
        self._stream = new_recording(name, sinks)
        self._recorder = Recorder(self._stream, config)
        self._T_map_odom = np.eye(4)
        self._true_track = Track(self._recorder.config.track_spacing)
        low, high = self._log_arena()
        self._log_robot()
        self._stream.send_blueprint(blueprint(low, high))

    def log_look(self, step: int, explorer: Explorer, look: Look) -> None:
        """Log what a look brought and what has become of the maps."""
        self._T_map_odom = explorer.localisation.T_map_odom
        self._true_track.add(self._robot.trajectory[-1].T_world_base[:3, 3])
        self._recorder.log_look(step, explorer, look)
        self._log_joints()
        if self._robot.config.odometry == "wheel":
            track = drawings.trajectory(self._true_track.positions, TRUE_TRACK_COLOUR)
            self._stream.log("world/trajectory/true", track)

    def log_motion(self, pose: Pose) -> None:
        """Log where the robot is between looks; meant for every control period, thinned to a few a second."""
        self._true_track.add(pose.T_world_base[:3, 3])
        if self._recorder.log_motion(pose.time, self._T_map_odom @ pose.T_odom_base):
            self._log_joints()

    def log_message(self, level: Level, text: str) -> None:
        """Log a line for people to read."""
        self._recorder.log_message(level, text)

    def close(self) -> None:
        """Log the maps as they are at the end, and write what is still on its way to the sinks."""
        self._recorder.close()

    def _log_arena(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """A mesh per label, where the geoms are now; returns the corners (3,) of the box around them."""
        labels = geom_labels(self._model)
        low, high = np.full(3, np.inf, np.float32), np.full(3, -np.inf, np.float32)
        geoms = self._geoms[~self._is_robot[self._model.geom_bodyid[self._geoms]]]
        for label in Label:
            chosen = geoms[labels[geoms] == label]
            if not len(chosen):
                continue
            poses = [self._pose(self._data.geom_xmat[g], self._data.geom_xpos[g]) for g in chosen]
            mesh = joined_mesh(self._model, chosen, poses)
            self._stream.log(f"world/arena/{label.name.lower()}", _mesh3d(mesh), static=True)
            low, high = (
                np.minimum(low, mesh.vertices.min(axis=0)),
                np.maximum(high, mesh.vertices.max(axis=0)),
            )
        return low, high

    def _log_robot(self) -> None:
        """A mesh per body, in the body's frame."""
        for body in np.unique(self._model.geom_bodyid[self._geoms]).tolist():
            if self._is_robot[body]:
                geoms = self._geoms[self._model.geom_bodyid[self._geoms] == body]
                mesh = joined_mesh(self._model, geoms, geom_poses(self._model, geoms))
                entity = self._entity(body)
                self._stream.log(entity, _mesh3d(mesh), static=True)
                if not self._model.body_jntnum[body]:
                    self._stream.log(entity, drawings.transform(self._T_base_body(body)), static=True)

    def _log_joints(self) -> None:
        """Where the bodies are that turn or slide against the robot's base."""
        moving = self._is_robot & (self._model.body_jntnum > 0)
        moving &= self._model.body_rootid != np.arange(self._model.nbody)
        for body in np.flatnonzero(moving).tolist():
            self._stream.log(self._entity(body), drawings.transform(self._T_base_body(body)))

    def _entity(self, body: int) -> str:
        return "world/robot/" + self._model.body(body).name.rpartition("/")[2]

    def _T_base_body(self, body: int) -> NDArray[np.float64]:
        T_world_base = self._robot.robot.T_world_base(self._robot.physics)
        return inverse(T_world_base) @ self._pose(self._data.xmat[body], self._data.xpos[body])

    @staticmethod
    def _pose(matrix: NDArray[np.float64], position: NDArray[np.float64]) -> NDArray[np.float64]:
        return from_rotation(matrix.reshape(3, 3), position)


def _mesh3d(mesh: Mesh) -> rr.Mesh3D:
    return rr.Mesh3D(
        vertex_positions=mesh.vertices,
        vertex_normals=mesh.normals,
        triangle_indices=mesh.triangles,
        vertex_colors=mesh.colours,
    )
