"""Driving by keyboard in MuJoCo's viewer."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import mujoco.viewer
import numpy as np
from dm_control import composer

from sarsim.task import CONTROL_TIMESTEP

SPACE, RIGHT, LEFT, DOWN, UP = 32, 262, 263, 264, 265
"""GLFW's key codes."""

ENDING = 10.0
"""s that the viewer may take to close its window."""
V_STEP, OMEGA_STEP = 0.1, 0.25
"""m/s and rad/s that a press adds."""

KEYS = """\
up, down      faster forwards, faster backwards
left, right   turn more to the left, more to the right
space         stop
Close the window to end."""


@dataclass
class Throttle:
    """The velocity command that the keys set; the viewer tells presses but no releases, so each press is a step.

    Attributes:
        max_v, max_omega: m/s and rad/s, either way.
        v, omega: as they are now.
    """

    max_v: float
    max_omega: float
    v: float = 0.0
    omega: float = 0.0

    def press(self, key: int) -> None:
        """Take a key, by its GLFW code, into account."""
        forwards, leftwards = (key == UP) - (key == DOWN), (key == LEFT) - (key == RIGHT)
        held = 0.0 if key == SPACE else 1.0
        self.v = _limited(held * self.v + forwards * V_STEP, self.max_v)
        self.omega = _limited(held * self.omega + leftwards * OMEGA_STEP, self.max_omega)


def drive_by_keyboard(environment: composer.Environment, interrupted: Callable[[], bool] = lambda: False) -> None:
    """Open a window and follow the keys in real time until it is closed, or ``interrupted`` says so.

    An exception between two steps would leave the viewer's thread waiting for a lock that nobody gives back.
    """
    environment.reset()
    throttle = Throttle(*environment.action_spec().maximum)
    physics = environment.physics
    others = set(threading.enumerate())
    with mujoco.viewer.launch_passive(
        physics.model.ptr, physics.data.ptr, key_callback=throttle.press, show_left_ui=False, show_right_ui=False
    ) as window:
        _follow(window.cam, physics.bind(environment.task.robot.base).element_id)
        while window.is_running() and not interrupted():
            due = time.monotonic() + CONTROL_TIMESTEP
            with window.lock():
                environment.step(np.array([throttle.v, throttle.omega]))
            window.sync()
            time.sleep(max(0.0, due - time.monotonic()))
    for thread in set(threading.enumerate()) - others:
        thread.join(ENDING)  # until it ends, the viewer draws from the model and the data


def _follow(camera: mujoco.MjvCamera, body: int) -> None:
    """Let the viewer's camera keep to a body, from above and behind where the robot starts."""
    camera.type = mujoco.mjtCamera.mjCAMERA_TRACKING
    camera.trackbodyid = body
    camera.distance, camera.azimuth, camera.elevation = 3.0, 0.0, -60.0


def _limited(value: float, limit: float) -> float:
    return float(np.clip(value, -limit, limit))
