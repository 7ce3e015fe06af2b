"""A navigator whose commands a robot follows."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from pipeline.navigation.commands import Outcome, Verdict
from pipeline.navigation.config import FollowerConfig, NavigationConfig
from pipeline.navigation.course import Course
from pipeline.navigation.navigator import Navigator
from pipeline.planning.stretches import Stretch, stretches_of
from pipeline.robot import Robot, Velocity
from pipeline.transforms import yaw_of


class Follower(Navigator):
    """Leads a robot, which follows each command unless ``watch`` finds fault with it."""

    def __init__(self, robot: Robot, hold_gain: float = 1.0):
        config = NavigationConfig(follower=replace(FollowerConfig(), hold_gain=hold_gain))
        super().__init__(robot.model, robot.control_period, config)
        self.robot = robot

    def way(self, waypoints, heading=None, backwards=None, arcs: bool = False) -> list[Stretch]:
        """The way from where the robot is through points (N, 2), with arcs or without."""
        if self.motion is None:
            self.add_motion(self.robot.drive(Velocity()))
        T, backwards = self.T_map_base, np.zeros(len(waypoints), np.bool_) if backwards is None else backwards
        start = np.append(T[:2, 3], yaw_of(T))
        return stretches_of(np.asarray(waypoints, float), backwards, start, heading, lambda poses: arcs)

    def drive(
        self,
        waypoints,
        heading=None,
        backwards=None,
        arcs: bool = False,
        watch: Callable[[Velocity], Verdict] = lambda command: Verdict.FINE,
        **kwargs,
    ) -> bool:
        """Drive through way points; True if all of them, and the heading, were reached."""
        way = self.way(waypoints, heading, backwards, arcs)
        return self.follow(Course(way, heading, **kwargs), partial(self.send, watch=watch)) is Outcome.REACHED

    def send(self, command: Velocity, watch: Callable[[Velocity], Verdict] = lambda command: Verdict.FINE) -> Verdict:
        """Let the robot follow a command unless ``watch`` finds fault with it."""
        verdict = watch(command) if command != Velocity() else Verdict.FINE
        if verdict is Verdict.FINE:
            self.add_motion(self.robot.drive(command))
        return verdict
