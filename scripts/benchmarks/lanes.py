"""Autonomous traverses of RoboCup Rescue lanes, judged by the robot's true pose.

The goal of each try is the middle of the other end zone; the maps persist from try to try. After a try that fails, or
after which the robot cannot continue, the lane is reset. The robot then starts with empty maps in the end zone where
the next try begins.
"""

from collections import Counter
from contextlib import closing
from dataclasses import asdict, dataclass
from statistics import median

import numpy as np
from dm_control import mjcf

from pipeline.errors import InputError
from pipeline.exploration.mission import Goals
from pipeline.explorer import Explorer
from pipeline.localisation.localisation import LostError
from pipeline.robot import Motion
from pipeline.run import explore
from pipeline.sink import Sink
from sarsim.arenas.arena import RescueArena
from sarsim.commands.cli import progress
from sarsim.composition import make_mapper
from sarsim.plugins.lanes.judge import LaneJudge, fallen_posts
from sarsim.plugins.lanes.lane_builders import build_lane
from sarsim.plugins.lanes.lanes import LANES
from sarsim.robots.model import robot_model
from sarsim.settings import EpisodeConfig
from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
from scripts.benchmarks.common import Result, check_at_least
from scripts.benchmarks.settings import LanesSettings

TIME_LIMIT = 300.0  # s, time limit of a try; an assumption, because the published rules do not state one
REACHED = "reached"  # How a try ends if the robot has arrived at the goal


@dataclass(frozen=True)
class LaneTry:
    """One try to drive through a lane.

    Attributes:
        towards: sign of the x coordinate of the end zone into which the robot drives, +1 or −1.
        ended: ``reached`` the goal, ``given_up``, ``held``, ``lost``, ``tipped`` or ``time``.
        seconds: time until the robot had crossed the lane, s; None without a traverse.
        posts: number of posts that fell.
    """

    towards: int
    ended: str
    seconds: float | None
    posts: int

    @property
    def needs_reset(self) -> bool:
        """Whether the try failed, or the robot cannot continue from its current position."""
        return self.seconds is None or self.ended in ("lost", "tipped", "time")


def measure(settings: LanesSettings) -> Result:
    """Traverses, times, fallen posts and resets of each lane, or why the robot's body is unsuited to the lane."""
    check_at_least(1, settings, "repetitions")
    check_at_least(0, settings, "seed")
    lanes = settings.lanes or tuple(LANES)
    if unknown := [lane for lane in lanes if lane not in LANES]:
        raise InputError(f"--lanes {' '.join(unknown)}: no such lane; use {', '.join(LANES)}")
    model = robot_model(settings.robot)
    forbidden = {lane: reason for lane in lanes if (reason := LANES[lane].unsuitability(model)) is not None}
    tries: dict[str, list[LaneTry]] = {lane: [] for lane in lanes}
    with progress(transient=True) as bars:
        able = [lane for lane in lanes if lane not in forbidden]
        bar = bars.add_task("lanes", total=len(able) * settings.repetitions)
        for lane in able:
            with closing(LaneRepetitions(lane, settings)) as repetitions:
                while len(tries[lane]) < settings.repetitions:
                    tries[lane].append(repetitions.next_try())
                    bars.update(bar, advance=1, description=f"lanes/{lane}")
    notes = [f"{lane}: cannot: {reason}" for lane, reason in forbidden.items()]
    for lane, made in tries.items():
        ended = Counter(t.ended for t in made if t.seconds is None)
        notes += [f"{lane}: tries without a traverse: {count} {how}" for how, count in ended.items()]
    return Result(
        figures(tries, settings.repetitions),
        {"cannot": forbidden, "tries": {lane: [asdict(t) for t in made] for lane, made in tries.items()}},
        notes,
    )


class LaneRepetitions:
    """Successive tries in one lane, in alternating directions."""

    def __init__(self, lane: str, settings: LanesSettings):
        self._lane, self._settings, self._number = lane, settings, 0
        self._drive: LaneDrive | None = None

    def next_try(self) -> LaneTry:
        """Try to drive through the lane from the robot's position, which a reset may have changed."""
        towards = 1 if self._number % 2 == 0 else -1
        if self._drive is None:
            self._drive = LaneDrive(self._lane, -towards, self._settings, self._settings.seed + self._number)
        made = self._drive.go(towards)
        self._number += 1
        if made.needs_reset:
            self.close()
        return made

    def close(self) -> None:
        """Remove the robot from the lane."""
        if self._drive is not None:
            self._drive.close()
        self._drive = None


class _TryEndsError(Exception):
    """The judge has ended the try."""


class LaneDrive(Sink):
    """A robot with initially empty maps in a newly set up lane."""

    def __init__(self, lane: str, end: int, settings: LanesSettings, seed: int):
        """Place the robot in the end zone on the side ``end``, ±1, of x, facing the lane."""
        simulation = SimulationConfig(speed=EpisodeConfig().speed, robot=settings.robot)
        self._lane = LANES[lane]
        self._robot = SimulatedRobot(lane_from(lane, end), simulation, seed)
        self._explorer = Explorer(
            self._robot, make_mapper(settings, self._robot.model, seed, sensor=self._robot.sensor)
        )
        self._explorer.watch(self)
        self._judge: LaneJudge | None = None

    def on_motion(self, motion: Motion) -> None:
        """Raise an error that ends the drive if the judge ends the try."""
        if self._judge and not self._judge.see(self._robot.time, self._robot.trajectory[-1].T_world_base):
            raise _TryEndsError

    def go(self, towards: int) -> LaneTry:
        """Try to drive into the end zone on the side ``towards``, ±1, of x."""
        physics = self._robot.physics
        before = fallen_posts(physics.model.ptr, physics.data.ptr)
        self._judge = judge = LaneJudge(self._lane, self._robot.model, towards, self._robot.time, TIME_LIMIT)
        try:
            ended = self._drive_to(towards)
        except _TryEndsError:
            ended = "tipped" if judge.has_tipped else "time"
        except LostError:
            ended = "lost"
        fell = fallen_posts(physics.model.ptr, physics.data.ptr) - before
        return LaneTry(towards, ended, judge.seconds, len(fell))

    def _drive_to(self, towards: int) -> str:
        """Drive to the middle of an end zone, even through unseen ground, and return how the drive ended."""
        goals = Goals([np.array([towards * self._lane.goal_distance, 0.0])])
        self._explorer.mission.goals = goals
        explore(self._explorer)
        is_reached = any(visit.failure_reason is None for visit in goals.visits)
        return REACHED if is_reached else "held" if self._explorer.is_held else "given_up"

    def close(self) -> None:
        """Free the simulator."""
        self._robot.close()


def lane_from(lane: str, end: int) -> RescueArena:
    """A lane whose start is in the end zone on the side ``end``, ±1, of x, facing the lane."""
    return RescueArena(mjcf.from_xml_string(build_lane(lane, end).to_xml()), lane)


def figures(tries: dict[str, list[LaneTry]], repetitions: int) -> dict[str, float]:
    """The figures of all lanes, by name."""
    found: dict[str, float] = {}
    for lane, made in tries.items():
        seconds = [t.seconds for t in made if t.seconds is not None]
        counts = {
            "repetitions": repetitions,
            "attempted": len(made),
            "successful": len(seconds),
            "posts": sum(t.posts for t in made),
            "resets": sum(t.needs_reset for t in made),
            "tipped": sum(t.ended == "tipped" for t in made),
        }
        found |= {f"{lane}.{name}": count for name, count in counts.items()}
        if seconds:
            found[f"{lane}.seconds.median"] = median(seconds)
    return found
