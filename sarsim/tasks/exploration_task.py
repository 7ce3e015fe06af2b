"""What the tasks of exploration share: their actions, observations, and end."""

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
"""Rows and columns of the local maps."""
FARTHEST_COORDINATE = 10_000.0
"""m; poses are cut off here."""
ROBOT_COLOUR = (220, 40, 40)

Action = int | np.integer[Any] | NDArray[np.float32]
Maps = dict[str, NDArray[Any]]


class ExplorationTask(gymnasium.Env[Any, Any]):
    """Explore from viewpoint to viewpoint.

    An action is the number of a viewpoint in the observation (``action="viewpoint"``; a number past the last counts
    from the first again), or x, y and heading (``action="pose"``), each in [-1, 1]: a place in the local map, with x
    along its columns, and half turns. The robot goes to the nearest place that it can reach, and turns to the
    heading.

    An observation has the local maps ``elevation`` in m, ``label`` and ``seen`` (64, 64), the robot in the middle and
    rows along y; ``pose``: x, y in m from the start, cosine and sine of the heading; ``viewpoints`` (32, 4): x, y and
    length of the way in ranges of the sensor from the robot, and a share of what is left to see, nearest first, zeros
    where there are no more; ``frontiers``: their number.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as the base class declares it
        "render_modes": ["rgb_array"],
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(self, action: Literal["viewpoint", "pose"], render_mode: str | None):
        """``action``: what an action is; InputError if it is neither. ``render_mode``: rgb_array, or None."""
        if action not in ("viewpoint", "pose"):
            raise InputError(f"action {action!r}: must be viewpoint or pose")
        self.by_pose, self.render_mode, self._is_closed = action == "pose", render_mode, False
        self.action_space = spaces.Box(-1.0, 1.0, (3,), np.float32) if self.by_pose else spaces.Discrete(VIEWPOINTS)
        self.observation_space = observation_space()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        """Begin an episode; InputError if the task was closed."""
        super().reset(seed=seed)
        self.check_open()

    def close(self) -> None:
        """End the task: it cannot be used any more."""
        self._is_closed = True

    def check_open(self) -> None:
        """Raises InputError if the task was closed."""
        if self._is_closed:
            raise InputError("the task is closed")


def wanted_pose(action: Action) -> tuple[NDArray[np.float64], float]:
    """(2,) x and y in halves of the local map's side from the robot, and the heading, rad, that an action names."""
    x, y, turn = np.clip(np.asarray(action, np.float64), -1, 1).tolist()
    return np.array([x, y]), turn * np.pi


def observation(
    maps: Mapping[str, NDArray[Any]], place: ArrayLike, heading: float, viewpoints: ArrayLike, frontiers: int
) -> Maps:
    """An observation within the bounds of its space.

    Args:
        maps: ``elevation``, ``label`` and ``seen``, (64, 64).
        place: (2,) x and y from the start, m.
        heading: rad.
        viewpoints: (N, 4) rows, at most 32.
        frontiers: their number.
    """
    far, rows = FARTHEST_COORDINATE, np.zeros((VIEWPOINTS, 4), np.float32)
    found = np.asarray(viewpoints, np.float64).reshape(-1, 4)
    rows[: len(found)] = np.clip(found, -far, far)
    pose = np.clip(np.array([*np.asarray(place), np.cos(heading), np.sin(heading)], np.float32), -far, far)
    count = np.array([min(frontiers, far)], np.float32)
    return {**maps, "pose": pose, "viewpoints": rows, "frontiers": count}


def action_mask(count: int) -> NDArray[np.int8]:
    """(32,) which numbers of viewpoints mean one of ``count``; one does in any case."""
    return (np.arange(VIEWPOINTS) < max(count, 1)).astype(np.int8)


def observation_space() -> spaces.Dict:
    """The space of the observations; see :class:`ExplorationTask`."""
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
