"""Driving the robot by keyboard or gamepad in MuJoCo's viewer."""

import os
import stat
import struct
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import mujoco
import mujoco.viewer
import numpy as np

from pipeline.errors import InputError, required
from pipeline.files import run_all
from pipeline.mapper import Keyframe, sense_and_map
from pipeline.robot import Robot, Velocity
from pipeline.run import MappingRun
from pipeline.sink import Result, Sink
from sarsim.arenas.arena import RescueArena
from sarsim.composition import compose, make_mapper
from sarsim.environment import CONTROL_TIMESTEP, RescueEnvironment
from sarsim.methods.plugins import make_plugins
from sarsim.recording import EpisodeRecorder
from sarsim.robots.names import ROBOTS
from sarsim.scoring.coverage import Coverage
from sarsim.scoring.navigation import NavigationScore
from sarsim.scoring.trajectory import TrajectoryScore
from sarsim.settings import PerceptionConfig, TeleopConfig
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from sarsim.trial_drive import warn_of_symptoms

SPACE, RIGHT, LEFT, DOWN, UP = 32, 262, 263, 264, 265
"""GLFW's key codes."""

CLOSING_TIMEOUT = 10.0
"""s, the maximum time to wait for the viewer to close its window."""
V_STEP, OMEGA_STEP = 0.1, 0.25
"""Change of the command per key press, m/s and rad/s."""

JS_EVENT, AXIS_EVENT, AXIS_MAX = struct.Struct("=IhBB"), 0x02, 32767.0
"""Linux's ``js_event`` (time in ms, value, type, number; see joystick-api.rst), and an axis's type and maximum."""
SIDEWAYS, LENGTHWAYS = 0, 1
"""Numbers of the left stick's axes, whose values are positive to the right and towards the user."""
DEAD_ZONE = 0.1
"""Dead zone: a stick is treated as released up to this fraction of its full deflection."""

KEYS = """\
up, down      drive faster forwards, faster backwards
left, right   turn faster to the left, faster to the right
space         stop
Close the window to end the drive."""


@dataclass
class Throttle:
    """The velocity command that the keys set; the viewer reports only key presses, so each press is one step.

    Attributes:
        max_v, max_omega: maximum magnitudes, m/s and rad/s.
        v, omega: the current command, m/s and rad/s.
    """

    max_v: float
    max_omega: float
    v: float = 0.0
    omega: float = 0.0

    def press(self, key: int) -> None:
        """Change the command according to the key with this GLFW code."""
        forwards, leftwards = (key == UP) - (key == DOWN), (key == LEFT) - (key == RIGHT)
        held = 0.0 if key == SPACE else 1.0
        self.v = _limited(held * self.v + forwards * V_STEP, self.max_v)
        self.omega = _limited(held * self.omega + leftwards * OMEGA_STEP, self.max_omega)


class Gamepad:
    """A Linux joystick; the further its left stick is pushed, the faster the robot drives."""

    def __init__(self, path: Path):
        """Open a device such as /dev/input/js0.

        Raises:
            InputError: the path is missing, is not a device, or cannot be read.
        """
        try:
            self._file = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            raise InputError(f"--gamepad {path}: cannot be opened: {error.strerror}") from error
        if not stat.S_ISCHR(os.fstat(self._file).st_mode):
            os.close(self._file)
            raise InputError(f"--gamepad {path}: must be a joystick device, such as /dev/input/js0")
        self._rest = b""

    def steer(self, throttle: Throttle) -> None:
        """Update the throttle with the events since the last call; an unplugged gamepad stops the robot."""
        try:
            data = os.read(self._file, 64 * JS_EVENT.size)
        except BlockingIOError:  # no events
            return
        except OSError:
            data = b""
        if not data:
            throttle.v = throttle.omega = 0.0
        self._rest += data
        whole = len(self._rest) // JS_EVENT.size * JS_EVENT.size
        for _, value, kind, number in JS_EVENT.iter_unpack(self._rest[:whole]):
            share = -value / AXIS_MAX if abs(value) > DEAD_ZONE * AXIS_MAX else 0.0
            if kind == AXIS_EVENT and number == LENGTHWAYS:
                throttle.v = _limited(share * throttle.max_v, throttle.max_v)
            elif kind == AXIS_EVENT and number == SIDEWAYS:
                throttle.omega = _limited(share * throttle.max_omega, throttle.max_omega)
        self._rest = self._rest[whole:]


class FreeDrive:
    """A robot that drives, but senses nothing.

    Attributes:
        physics: physics of the arena with the robot.
        base_body: id of the robot's base body.
        limits: top speed and turn rate, m/s and rad/s.
        control_period: s, the duration of a command.
    """

    control_period = CONTROL_TIMESTEP

    def __init__(self, arena: RescueArena, robot: str = ROBOTS[0]):
        warn_of_symptoms(robot)
        self._environment = RescueEnvironment(arena, robot)
        self.physics = self._environment.physics
        self.base_body = self.physics.bind(self._environment.robot.base).element_id
        self.limits = self._environment.robot.drive.limits

    def drive(self, command: Velocity) -> None:
        """Follow ``command`` for one control period."""
        self._environment.drive(command)


def drive_by_keyboard(
    driven: "FreeDrive | MappedDrive", interrupted: Callable[[], bool] = lambda: False, gamepad: Gamepad | None = None
) -> None:
    """Open a window, and obey keys and gamepad in real time until the window closes or ``interrupted`` returns True.

    ``interrupted`` is polled between steps, because an exception during a step would leave the viewer's thread
    waiting for a lock that is never released.
    """
    throttle, physics = Throttle(*driven.limits), driven.physics
    others = set(threading.enumerate())
    try:
        with mujoco.viewer.launch_passive(
            physics.model.ptr, physics.data.ptr, key_callback=throttle.press, show_left_ui=False, show_right_ui=False
        ) as window:
            _follow(window.cam, driven.base_body)
            while window.is_running() and not interrupted():
                due = time.monotonic() + driven.control_period
                if gamepad:
                    gamepad.steer(throttle)
                with window.lock():
                    driven.drive(Velocity(throttle.v, throttle.omega))
                window.sync()
                time.sleep(max(0.0, due - time.monotonic()))
    finally:
        for thread in set(threading.enumerate()) - others:
            thread.join(CLOSING_TIMEOUT)  # until its thread ends, the viewer reads the model and the data


class _Score(Sink):
    """Adds the coverage, navigation and localisation of a manual drive to its report."""

    def __init__(self, robot: SimulatedRobot, trajectory: TrajectoryScore):
        self._robot, self._trajectory, self._coverage = robot, trajectory, Coverage(robot)
        self._navigation = NavigationScore(robot, self._coverage.surface)

    def on_keyframe(self, keyframe: Keyframe) -> None:
        """Add the newest keyframe to the scores."""
        self._trajectory.add()
        self._coverage.see(required(self._robot.true_frame).points())

    def finish(self, result: Result) -> None:
        """Add the scores to the report."""
        result.add(
            {
                "navigation": self._navigation.report(),
                "exploration": {"explored_fraction": self._coverage.fraction},
                "localisation": self._trajectory.report(),
            }
        )


class MappedDrive(MappingRun):
    """Maps the arena while a person drives the robot, and writes the files of an episode.

    Attributes:
        physics, base_body, control_period, limits: as in :class:`FreeDrive`.
    """

    def __init__(self, config: TeleopConfig, arena: RescueArena, out: Path, is_shown: bool = False):
        """Take the first keyframe at the start pose; if ``is_shown``, open a Rerun window that shows the maps.

        Raises:
            InputError: the labels, the detector, the robot, the window or the folder for results are not available.
        """
        plugins = make_plugins(config)
        for plugin in plugins:
            plugin.add_to_arena(arena)
        self._robot = robot = SimulatedRobot(arena, SimulationConfig(robot=config.robot), seed=0)
        self.physics, self.base_body, self.control_period = robot.physics, robot.base_body, robot.control_period
        self.limits = robot.robot.drive.limits
        with ExitStack() as refused:
            refused.callback(robot.close)
            perception = PerceptionConfig(labels=config.labels, reader=config.reader, pipeline=config.pipeline)
            mapper = make_mapper(perception, robot.model, plugins=plugins, sensor=robot.sensor)
            self._driven: Robot = robot
            for plugin in plugins:
                refused.callback(plugin.abandon)
                self._driven = plugin.wrap(self._driven, robot, mapper)
            self._trajectory = TrajectoryScore(mapper.localisation, robot.trajectory)
            recorder = partial(EpisodeRecorder, robot)
            view: Literal["spawn", "none"] = "spawn" if is_shown else "none"
            others = [_Score(robot, self._trajectory)]
            super().__init__(
                compose(
                    config,
                    mapper,
                    out,
                    config.arena,
                    view=view,
                    recorder=recorder,
                    others=others,
                    plugins=plugins,
                    world=robot,
                )
            )
            refused.pop_all()
        self._start_time = robot.time
        self._take_keyframe()

    def drive(self, command: Velocity) -> None:
        """Follow ``command`` for one control period, and take a keyframe if the robot has moved far enough."""
        motion = self._driven.drive(command)
        for sink in self.parts.sinks:
            sink.on_motion(motion)
        if self.mapper.is_due(motion.T_odom_base):
            self._take_keyframe()

    def _take_keyframe(self) -> None:
        """Take a keyframe, unless it would repeat an earlier one."""
        self.mapper.apply_corrections(only_if_due=True)
        keyframe = sense_and_map(self.mapper, self._driven.sense, labelled=True)
        if keyframe is not None:
            self.mapper.update_topological_map(keyframe)
            self.show(keyframe)

    def save(self) -> None:
        """End the recording, and write the maps, the report and the page; InputError if any write fails."""
        steps, sim_time = len(self.mapper.keyframes), self._robot.time - self._start_time
        run_all(lambda: self.finish(self._trajectory, steps, sim_time, {}), self._robot.close)


def _follow(camera: mujoco.MjvCamera, body: int) -> None:
    """Make the viewer's camera track a body obliquely from above, looking along the world's x-axis."""
    camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
    camera.trackbodyid = body
    camera.distance, camera.azimuth, camera.elevation = 3.0, 0.0, -60.0


def _limited(value: float, limit: float) -> float:
    return float(np.clip(value, -limit, limit))
