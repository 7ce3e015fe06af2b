"""What the exploration tasks share: actions, observations and closing."""

from collections.abc import Mapping
from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from pipeline.errors import InputError
from pipeline.labels import Label
from sarsim.tasks.settings import VIEWPOINTS

LOCAL_SIDE = 64
"""Number of rows, and of columns, of the local maps."""
FARTHEST_COORDINATE = 10_000.0
"""Coordinates in observations are clipped to this, m."""
ROBOT_COLOUR = (220, 40, 40)
CLOSED = "the task is closed; create a new one with gymnasium.make"
NOT_RESET = "the task has not been reset; call reset() before step()"

Action = int | np.integer[Any] | NDArray[np.float32]
Maps = dict[str, NDArray[Any]]


class ExplorationTask(gymnasium.Env[Any, Any]):
    """Explore from viewpoint to viewpoint.

    An action is the number of a viewpoint in the observation (``action="viewpoint"``; numbers beyond the last wrap
    around), or x, y and heading (``action="pose"``), each in [-1, 1]: x and y are in halves of the local map's side
    from the robot, x along the map's columns, and the heading is in half turns. The robot goes to the nearest place
    that it can reach, and turns to the heading.

    An observation has the local maps ``elevation`` (m), ``label`` and ``seen`` (64, 64), with the robot in the middle
    and rows along y; ``pose``: x, y from the start, m, and cosine and sine of the heading; ``viewpoints`` (32, 4):
    x, y and path length from the robot, in units of the sensor's range, and the share of what is left to see that
    the viewpoint shows, nearest first, padded with zeros; ``frontiers``: their number.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as the base class declares it
        "render_modes": ["rgb_array"],
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(self, action: Literal["viewpoint", "pose"], render_mode: str | None):
        """``action``: kind of actions; InputError if unknown. ``render_mode``: rgb_array, or None."""
        if action not in ("viewpoint", "pose"):
            raise InputError(f"action = {action!r}: must be 'viewpoint' or 'pose'")
        self.by_pose, self.render_mode, self._is_closed = action == "pose", render_mode, False
        self.action_space = spaces.Box(-1.0, 1.0, (3,), np.float32) if self.by_pose else spaces.Discrete(VIEWPOINTS)
        self.observation_space = observation_space()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Begin an episode; InputError if the task was closed."""
        super().reset(seed=seed)
        self.check_open()

    def close(self) -> None:
        """Close the task, after which it cannot be used."""
        self._is_closed = True

    def check_open(self) -> None:
        """Raise InputError if the task was closed."""
        if self._is_closed:
            raise InputError(CLOSED)


def wanted_pose(action: Action) -> tuple[NDArray[np.float64], float]:
    """The pose of an action: (2,) x, y from the robot in halves of the local map's side, and the heading, rad."""
    x, y, turn = np.clip(np.asarray(action, np.float64), -1, 1).tolist()
    return np.array([x, y]), turn * np.pi


def observation(
    maps: Mapping[str, NDArray[Any]], place: ArrayLike, heading: float, viewpoints: ArrayLike, frontiers: int
) -> Maps:
    """An observation, clipped to the bounds of its space.

    Args:
        maps: ``elevation``, ``label`` and ``seen``, (64, 64).
        place: (2,) x and y from the start, m.
        heading: heading of the robot, rad.
        viewpoints: (N, 4) rows, at most 32.
        frontiers: number of frontiers.
    """
    far, rows = FARTHEST_COORDINATE, np.zeros((VIEWPOINTS, 4), np.float32)
    found = np.asarray(viewpoints, np.float64).reshape(-1, 4)
    rows[: len(found)] = np.clip(found, -far, far)
    pose = np.clip(np.array([*np.asarray(place), np.cos(heading), np.sin(heading)], np.float32), -far, far)
    count = np.array([min(frontiers, far)], np.float32)
    return {**maps, "pose": pose, "viewpoints": rows, "frontiers": count}


def action_mask(count: int) -> NDArray[np.int8]:
    """(32,) 1 for each action that selects one of ``count`` viewpoints, and always for action 0; otherwise 0."""
    return (np.arange(VIEWPOINTS) < max(count, 1)).astype(np.int8)


def observation_space() -> spaces.Dict:
    """The observation space; see :class:`ExplorationTask`."""
    far = FARTHEST_COORDINATE
    low, high = np.array([-far, -far, -1, -1], np.float32), np.array([far, far, 1, 1], np.float32)
    return spaces.Dict(
        {
            "elevation": spaces.Box(-far, far, (LOCAL_SIDE, LOCAL_SIDE), np.float32),
            "label": spaces.Box(0, max(Label), (LOCAL_SIDE, LOCAL_SIDE), np.uint8),
            "seen": spaces.Box(0, 1, (LOCAL_SIDE, LOCAL_SIDE), np.uint8),
            "pose": spaces.Box(low, high, dtype=np.float32),
            "viewpoints": spaces.Box(-far, far, (VIEWPOINTS, 4), np.float32),
            "frontiers": spaces.Box(0, far, (1,), np.float32),
        }
    )
