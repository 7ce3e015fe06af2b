"""``sarsim/Explore-v0``: explore an arena in MuJoCo, viewpoint by viewpoint, with the robot's own software."""

import gc
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import gymnasium
import numpy as np
from dm_control.rl.control import PhysicsError
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from pipeline.errors import InputError, required
from pipeline.exploration.next_best_view import NextBestView
from pipeline.exploration.viewpoint import Viewpoint
from pipeline.explorer import Explorer
from pipeline.localisation.localisation import LostError
from pipeline.mapper import Mapper
from pipeline.plugin import Plugin, RunContext
from pipeline.sink import Step
from pipeline.transforms import yaw_of
from sarsim.composition import make_mapper
from sarsim.methods.arena import make_arena
from sarsim.methods.make import make_localisation
from sarsim.methods.plugins import make_plugins
from sarsim.settings import DEFAULT_DETECTOR, LabelSource, OdometryName, PerceptionConfig, SinkConfig, is_own_arena
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from sarsim.tasks.achievements import Achievements
from sarsim.tasks.checks import (
    CLOSED,
    NOT_RESET,
    USED,
    check_choice,
    check_options,
    choice_of,
    numbers_of,
    weights_of,
)
from sarsim.tasks.drive import MAX_SEEDS
from sarsim.tasks.observations import (
    LOCAL_CELL,
    LOCAL_SIDE,
    VIEWPOINTS,
    Maps,
    local_maps,
    observation,
    observation_space,
    picture,
)

FINDS_PLUGIN = "finds"
"""Name of the plug-in that a reward for finds requires."""
Action = int | np.integer[Any] | NDArray[np.float32]


@dataclass(frozen=True)
class ExploreWeights:
    """Weights of an exploring agent's reward, which is the weighted sum of a step's quantities.

    Attributes:
        ground: reward per m² of ground seen for the first time.
        time: reward per second.
        finds: reward per person or object found.
        contact: reward per contact with a wall, clutter or a victim.
        tipping: reward for tipping over, or if the simulation diverges.
    """

    ground: float = 1.0
    time: float = -0.1
    finds: float = 10.0
    contact: float = -1.0
    tipping: float = -10.0


DEFAULT_EXPLORE = ExploreWeights()


class Explore(gymnasium.Env[Any, Any]):
    """Explore an arena from viewpoint to viewpoint.

    With ``action="viewpoint"``, an action is the number of a viewpoint in the observation; numbers beyond the last
    wrap around. With ``action="pose"``, it is x, y and heading, each in [-1, 1]. The unit of x and y is half the side
    of the local map; both are relative to the robot, x along the map's columns. The unit of the heading is a half
    turn. The robot drives to the viewpoint, or to the nearest place that it can reach, with its own navigator and
    maps, and turns to the heading.

    An observation has these keys:

    - ``elevation``: (64, 64) m, local map of the ground's height, with the robot in the middle and rows along y;
    - ``label``: (64, 64), local map of the points' most frequent class;
    - ``seen``: (64, 64), local map of whether ground has been seen;
    - ``pose``: (4,) x and y from the start, m, and cosine and sine of the heading;
    - ``viewpoints``: (32, 4), nearest first, padded with zeros: x, y and path length from the robot, in units of the
      sensor's range, and the viewpoint's fraction of the total expected gain;
    - ``frontiers``: (1,) number of frontiers.

    The viewpoints are the ones that the robot's own explorer considers worth the drive. The gain of a viewpoint
    excludes ground that earlier chosen viewpoints show. Path length is the expected driving time multiplied by the
    robot's speed.

    An episode terminates when no viewpoint is worth the drive, when the robot cannot drive away, tips over or is
    lost, or when the simulation diverges. It is truncated after ``steps``.

    Attributes:
        explorer: the robot's software; None before the first reset.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as the base class declares it
        "render_modes": ["rgb_array"],
        "render_fps": 10,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        arena: str = "nist_6x4",
        *,
        robot: str = "pioneer3at",
        labels: LabelSource = "truth",
        detects: bool = False,
        odometry: OdometryName = "wheel",
        action: Literal["viewpoint", "pose"] = "viewpoint",
        steps: int = 160,
        weights: ExploreWeights | Mapping[str, float] = DEFAULT_EXPLORE,
        render_mode: str | None = None,
    ):
        """Choose the arena, the robot and its software.

        Args:
            arena: as in run_episode.py; ``random``: a new random arena for each episode.
            robot: as in run_episode.py.
            labels: as in run_episode.py; the default, the simulator's true labels, needs no network.
            detects: whether the robot detects people and objects with its networks. If so, the people and
                objects that it finds are rewarded; otherwise, all that come into view.
            odometry: as in run_episode.py.
            action: kind of actions.
            steps: number of steps after which an episode is truncated.
            weights: weights of the reward.
            render_mode: rgb_array, or None.

        Raises:
            InputError: a setting is wrong.
        """
        check_choice("action", action, ("viewpoint", "pose"))
        check_choice("odometry", odometry, get_args(OdometryName))
        check_choice("render_mode", render_mode, (None, "rgb_array"))
        if not isinstance(steps, int) or steps < 1:
            raise InputError(f"steps = {steps}: must be a whole number of at least 1")
        self._by_pose = action == "pose"
        self.render_mode = render_mode
        self.action_space = spaces.Box(-1.0, 1.0, (3,), np.float32) if self._by_pose else spaces.Discrete(VIEWPOINTS)
        self.observation_space = observation_space()
        self._is_closed = False
        self._arena, self._max_steps = arena, steps
        self._simulation = SimulationConfig(odometry, robot=robot)
        self._perception = PerceptionConfig(labels=labels, detector=DEFAULT_DETECTOR if detects else None)
        self._weights = weights_of(ExploreWeights, weights)
        self.explorer: Explorer | None = None
        self._robot: SimulatedRobot | None = None
        self._episode_options: dict[str, Any] = {}

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Maps, dict[str, Any]]:
        """Place the robot at the start of a new episode, and take the first keyframe.

        ``options["arena"]`` and ``options["seed"]`` are as in run_episode.py; by default they are the task's arena
        and a random seed. InputError if an option is unknown or invalid, or if the task is closed.
        """
        self._check_open()
        check_options(options, ("arena", "seed"))
        if not isinstance((options or {}).get("seed", 0), int | np.integer) or (options or {}).get("seed", 0) < 0:
            raise InputError(f"reset: seed = {(options or {})['seed']!r}: must be a whole number from 0 on")
        super().reset(seed=seed)
        drawn: dict[str, Any] = {
            "arena": f"random:{self.np_random.integers(MAX_SEEDS)}" if self._arena == "random" else self._arena,
            "seed": int(self.np_random.integers(MAX_SEEDS)),
        }
        self._episode_options, earlier = drawn | (options or {}), self._episode_options
        name, number = self._episode_options["arena"], self._episode_options["seed"]
        # A user-defined function may build a different arena for each seed.
        is_same = self._episode_options == earlier if is_own_arena(name) else name == earlier.get("arena")
        if self._robot is not None and is_same:
            self._robot.reset(number)
        else:
            self._free()
            self._robot = SimulatedRobot(make_arena(name, seed=number), self._simulation, number)
        plugins = make_plugins(SinkConfig(plugins={FINDS_PLUGIN: None} if self._weights.finds else {}))
        mapper = self._mapper(self._robot, plugins)
        self._strategy = NextBestView(self._robot.model, config=mapper.config.exploration)
        self.explorer = Explorer(self._robot, mapper, self._strategy)
        context = RunContext(mapper, None, self.explorer, self._robot, plugins)
        finds = [sink for plugin in plugins for sink in plugin.sinks(context)]
        self._achieved = Achievements(self._robot, self.explorer, finds)
        self.explorer.watch(self._achieved)
        self._steps, self._ended = 0, ""
        gc.collect()  # the maps of the last episode are in reference cycles
        self._look()
        return self._observation(), self._info()

    def _mapper(self, robot: SimulatedRobot, plugins: Sequence[Plugin]) -> Mapper:
        localisation = make_localisation(
            "slam", robot.model, self._perception.pipeline.localisation, self._simulation.odometry == "truth"
        )
        readers, seed = plugins if self._perception.detector else (), self._episode_options["seed"]
        return make_mapper(self._perception, robot.model, seed, localisation, plugins=readers, sensor=robot.sensor)

    def step(self, action: Action) -> tuple[Maps, float, bool, bool, dict[str, Any]]:
        """Drive to a viewpoint and take a keyframe; InputError if the action is invalid, or the task is not ready."""
        self._check_open()
        if self.explorer is None:
            raise InputError(NOT_RESET)
        if self._by_pose:
            numbers_of(action, 3)
        else:
            choice_of(action)
        before = self._achieved.totals
        self._steps += 1
        is_tipped = self._drive(action)
        ground, seconds, finds, contacts = self._achieved.totals - before
        w = self._weights
        reward = w.ground * ground + w.time * seconds + w.finds * finds + w.contact * contacts + w.tipping * is_tipped
        is_over = is_tipped or bool(self._ended)
        is_cut = not is_over and self._steps >= self._max_steps
        info = self._info() | ({"navigation.tipped": 1} if is_tipped else {})
        return self._observation(), float(reward), is_over, is_cut, info

    def render(self) -> NDArray[np.uint8] | None:
        """(480, 1120, 3) uint8 RGB, the camera's latest image and, to its right, a plan of the classes on the map."""
        if self.render_mode is None or self.explorer is None:
            return None
        return picture(self._seen.keyframe.frame.rgb, self._maps)

    def __getstate__(self) -> dict[str, Any]:
        """The state of the task for a copy; InputError after a reset, because the physics cannot be copied."""
        if self.explorer is not None:
            raise InputError(USED)
        return self.__dict__.copy()

    def close(self) -> None:
        """Free the physics; a closed task cannot be used."""
        self._is_closed = True
        self._free()

    def _check_open(self) -> None:
        if self._is_closed:
            raise InputError(CLOSED)

    def _free(self) -> None:
        if self._robot is not None:
            self._robot.close()
        self._robot = self.explorer = None

    def _drive(self, action: Action) -> bool:
        """Drive to a viewpoint and look there; return whether the robot tipped over or the simulation diverged."""
        explorer, viewpoint = required(self.explorer), self._chosen(action)
        try:
            if viewpoint is not None:
                explorer.drive(explorer.redirect(self._seen, viewpoint))
            if self._achieved.is_tipped:
                return True
            self._look()
        except LostError:
            self._ended = "lost"
        except PhysicsError:
            return True
        return self._achieved.is_tipped

    def _look(self) -> None:
        """Make a step of the explorer, and another one if no viewpoint was found and the maps were then corrected."""
        explorer = required(self.explorer)
        step = explorer.step()
        if step.viewpoint is None and explorer.apply_corrections():
            step = explorer.step()
        self._seen: Step = step
        offered = (
            self._strategy.worthwhile_viewpoints(step.context, step.viewpoint, VIEWPOINTS) if step.viewpoint else []
        )
        self._offered = sorted(offered, key=lambda viewpoint: viewpoint.seconds)
        self._ended = step.end_reason or ""
        self._maps = local_maps(explorer.mapper, step.keyframe.T_map_base)

    def _chosen(self, action: Action) -> Viewpoint | None:
        """The viewpoint to which an action sends the robot; None if there is none."""
        if not self._by_pose:
            return self._offered[choice_of(action) % len(self._offered)] if self._offered else None
        context = self._seen.context
        x, y, turn = np.clip(numbers_of(action, 3), -1, 1).tolist()
        ground = context.traversability
        places = ground.grid.centre_of(np.argwhere(ground.turnable & context.paths.reachable))
        if not len(places):
            return None
        wanted = context.T_map_base[:2, 3] + np.array([x, y]) * LOCAL_SIDE * LOCAL_CELL / 2
        place = places[np.linalg.norm(places - wanted, axis=1).argmin()]
        return Viewpoint(place, turn * np.pi, turn=True, gain=0.0)

    def _observation(self) -> Maps:
        T, robot = self._seen.keyframe.T_map_base, required(self._robot).model
        reach = self._seen.keyframe.frame.sensor.farthest
        left = sum(viewpoint.gain for viewpoint in self._offered) or 1.0  # the way back shows nothing
        keyframe_time = self._strategy.config.keyframe_time
        rows = [
            (*(v.position - T[:2, 3]) / reach, (v.seconds - keyframe_time) * robot.speed / reach, v.gain / left)
            for v in self._offered
        ]
        place = T[:2, 3] - required(required(self.explorer).T_map_start)[:2, 3]
        return observation(self._maps, place, yaw_of(T), rows, len(self._seen.frontiers))

    def _info(self) -> dict[str, Any]:
        """Figures under the keys of report.json, ``action_mask``, and ``own_choice``, the explorer's viewpoint."""
        own = [n for n, viewpoint in enumerate(self._offered) if viewpoint is self._seen.viewpoint]
        return {
            **self._episode_options,
            "steps": self._steps,
            "sim_time_s": self._achieved.seconds,
            **self._achieved.figures(),
            **({"exploration.ended": self._ended} if self._ended else {}),
            "action_mask": (np.arange(VIEWPOINTS) < max(len(self._offered), 1)).astype(np.int8),
            "own_choice": own[0] if own else 0,
        }
