"""``sarsim/Explore2D-v0``: explore a 2D map, viewpoint by viewpoint, without physics."""

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Rgb
from pipeline.errors import InputError
from pipeline.labels import Label
from pipeline.transforms import wrap_angle
from sarsim.tasks import grid_kernels as kernels
from sarsim.tasks.exploration_task import (
    LOCAL_SIDE,
    ROBOT_COLOUR,
    Action,
    ExplorationTask,
    Maps,
    action_mask,
    observation,
    wanted_pose,
)
from sarsim.tasks.grid_explorers import Sights, viewpoint_rows
from sarsim.tasks.grid_scenes import (
    DRAWINGS,
    SIZES,
    GridScene,
    draw_scene,
    dungeon_files,
    read_dungeon,
    read_ros_scene,
)
from sarsim.tasks.grid_world import RULES, GridWorld, route
from sarsim.tasks.settings import RewardWeights

LABEL_OF = np.array([Label.UNLABELLED, Label.TERRAIN, Label.WALL], np.uint8)
BELIEF_COLOURS = np.array([(127, 127, 127), (255, 255, 255), (0, 0, 0)], np.uint8)

DEFAULT_WEIGHTS = RewardWeights()


class Explore2D(ExplorationTask):
    """Explore a 2D map; actions and observations are those of :class:`ExplorationTask`.

    The robot looks at every node on the path to a viewpoint. A viewpoint's share of what is left to see is the share
    of the frontiers that it sees.

    An episode terminates when the map is explored or nothing is left to see; the rules' ``most_moves`` truncates it.
    """

    def __init__(
        self,
        maps: Path | str | None = None,
        *,
        split: str = "train",
        rules: str | None = None,
        action: Literal["viewpoint", "pose"] = "viewpoint",
        weights: RewardWeights | Mapping[str, float] = DEFAULT_WEIGHTS,
        render_mode: str | None = None,
    ):
        """Choose the maps, one of which is drawn for each episode.

        Args:
            maps: folder of dungeon maps, a dungeon map, or a ROS map's .yaml file; by default maps are generated.
            split: split of the generated maps: train, val or test.
            rules: camera or papers; by default papers for a folder, otherwise camera.
            action: kind of actions.
            weights: weights of the reward.
            render_mode: rgb_array, or None.

        Raises:
            InputError: a setting or a map is wrong.
        """
        self._files = _files(None if maps is None else Path(maps))
        self._name = rules or ("papers" if maps is not None and Path(maps).is_dir() else "camera")
        for name, value, known in (("rules", self._name, RULES), ("split", split, DRAWINGS)):
            if value not in known:
                *others, last = map(repr, known)
                raise InputError(f"{name} = {value!r}: must be {', '.join(others)} or {last}")
        super().__init__(action, render_mode)
        self._rules, self._split = RULES[self._name], split
        self._weights = weights if isinstance(weights, RewardWeights) else RewardWeights(**weights)
        self._stride = -(-2 * self._rules.reach // LOCAL_SIDE)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Maps, dict[str, Any]]:
        """Place the robot in the next map, and look all around.

        ``options["map"]`` is the number of the map in the split or the folder; by default it is random.
        """
        super().reset(seed=seed)
        self.world = GridWorld(self._scene((options or {}).get("map")), self._rules)
        self._steps = 0
        self._observe()
        return self._observation(), self._info()

    def step(self, action: Action) -> tuple[Maps, float, bool, bool, dict[str, Any]]:
        """Go to a viewpoint; see the class."""
        self.check_open()
        before, seconds = self.world.known_free, self.world.seconds
        node, heading = self._target(action)
        for stop in route(self._sights.before, self.world.here, node):
            self.world.move(stop)
            if self.world.is_explored or self.world.moves >= self._rules.most_moves:
                break
        if heading is not None and self._rules.field_of_view < 360:
            self.world.turn(heading)
        self._steps += 1
        self._observe()
        ground = (self.world.known_free - before) * self.world.scene.cell**2
        reward = self._weights.ground * ground + self._weights.time * (self.world.seconds - seconds)
        is_over = self.world.is_explored or not len(self._sights.frontiers)
        is_cut = not is_over and max(self.world.moves, self._steps) >= self._rules.most_moves
        return self._observation(), float(reward), is_over, is_cut, self._info()

    def render(self) -> Rgb | None:
        """The known part of the map, and the robot in red."""
        if self.render_mode is None:
            return None
        image: NDArray[np.uint8] = BELIEF_COLOURS[self.world.belief]
        row, col = self.world.nodes[self.world.here]
        half = self._rules.spacing // 2
        image[max(row - half, 0) : row + half + 1, max(col - half, 0) : col + half + 1] = ROBOT_COLOUR
        return image

    def _scene(self, number: int | None) -> GridScene:
        if self._files:
            index = int(self.np_random.integers(len(self._files))) if number is None else number % len(self._files)
            file = self._files[index]
            return _read(file)
        most = DRAWINGS["val"]
        index = int(self.np_random.integers(most)) if number is None else number % most
        return draw_scene(DRAWINGS[self._split] + index, *SIZES[self._name])

    def _observe(self) -> None:
        """Find out what is left to see, and from which viewpoints."""
        self._sights = Sights.of(self.world)
        self._rows, self._viewpoints = viewpoint_rows(self.world, self._sights)

    def _target(self, action: Action) -> tuple[int, float | None]:
        """The node to go to, and the heading there, rad, if any."""
        world, sights = self.world, self._sights
        if self.by_pose:
            away, heading = wanted_pose(action)
            place = world.nodes[world.here] + away[::-1] * LOCAL_SIDE * self._stride / 2
            nodes = np.append(np.flatnonzero(sights.before >= 0), world.here)
            return int(nodes[np.linalg.norm(world.nodes[nodes] - place, axis=1).argmin()]), heading
        if not len(self._rows):
            return world.here, None
        row = int(self._rows[int(action) % len(self._rows)])
        node = int(sights.nodes[row])
        ahead = sights.frontiers[sights.visible[row]] - world.nodes[node]
        bearings = np.arctan2(ahead[:, 0], ahead[:, 1])
        return node, best_heading(bearings, np.deg2rad(self._rules.field_of_view))

    def _observation(self) -> Maps:
        world = self.world
        known = kernels.local_map(world.belief, *world.nodes[world.here], LOCAL_SIDE, self._stride)
        maps = {
            "elevation": np.zeros((LOCAL_SIDE, LOCAL_SIDE), np.float32),
            "label": LABEL_OF[known],
            "seen": (known != kernels.IS_UNKNOWN).astype(np.uint8),
        }
        place = (world.nodes[world.here] - world.scene.start)[::-1] * world.scene.cell
        return observation(maps, place, world.heading, self._viewpoints, len(self._sights.frontiers))

    def _info(self) -> dict[str, Any]:
        """Figures under the keys of report.json, and ``action_mask`` for the numbers of viewpoints."""
        world, info = self.world, dict[str, Any]()
        info["steps"] = self._steps
        info["sim_time_s"] = self.world.seconds
        info["navigation.distance_m"] = world.way * world.scene.cell
        info["exploration.explored_fraction"] = world.explored_fraction
        info["exploration.frontiers_left"] = len(self._sights.frontiers)
        info["action_mask"] = action_mask(len(self._rows))
        return info


def best_heading(bearings: NDArray[np.float64], field_of_view: float) -> float:
    """The one of (N,) bearings, rad, around which a camera with this field of view, rad, sees most of the others."""
    apart = abs(wrap_angle(bearings[:, None] - bearings))
    return float(bearings[(apart <= field_of_view / 2).sum(axis=1).argmax()])


def _files(maps: Path | None) -> list[Path]:
    """The files of the maps; empty if maps are generated."""
    if maps is None:
        return []
    if not maps.exists():
        raise InputError(f"{maps}: no such file or folder")
    return dungeon_files(maps) if maps.is_dir() else [maps]


@lru_cache(maxsize=128)
def _read(file: Path) -> GridScene:
    """Read the map in a file, cached for further episodes."""
    return read_ros_scene(file) if file.suffix == ".yaml" else read_dungeon(file)
