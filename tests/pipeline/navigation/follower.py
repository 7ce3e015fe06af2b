"""A navigator whose commands a robot follows."""

from collections.abc import Callable
from dataclasses import replace

from pipeline.navigation.commands import Commands, Outcome, Verdict
from pipeline.navigation.config import FollowerConfig, NavigationConfig
from pipeline.navigation.navigator import Navigator
from pipeline.robot import Robot, Velocity


class Follower(Navigator):
    """Leads a robot, which follows each command unless ``watch`` finds fault with it."""

    def __init__(self, robot: Robot, hold_gain: float = 1.0):
        config = NavigationConfig(follower=replace(FollowerConfig(), hold_gain=hold_gain))
        super().__init__(robot.model, robot.control_period, config)
        self.robot = robot

    def drive(self, *args, watch: Callable[[Velocity], Verdict] = lambda command: Verdict.FINE, **kwargs) -> bool:
        """Drive through way points; True if all of them, and the heading, were reached."""
        return self._outcome(self.follow(*args, **kwargs), watch) is Outcome.REACHED

    def _outcome(self, commands: Commands, watch: Callable[[Velocity], Verdict]) -> Outcome:
        try:
            command = next(commands)
            while True:
                verdict = watch(command) if command != Velocity() else Verdict.FINE
                if verdict is Verdict.FINE:
                    self.moved(self.robot.drive(command))
                command = commands.send(verdict)
        except StopIteration as end:
            return end.value
