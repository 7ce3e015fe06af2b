"""A mission of the rescue leagues as a plug-in: its clock, its files and, in a simulation, its scores."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import Any

from pipeline.exploration.deadline import Deadline, TimeIsUpError
from pipeline.explorer import Explorer
from pipeline.plugin import Plugin, RunContext
from pipeline.plugins.league.brief import MissionBrief, Task
from pipeline.plugins.league.config import LeagueConfig
from pipeline.plugins.league.hand_in import LeagueFiles
from pipeline.plugins.league.inspection import Inspection
from pipeline.plugins.league.validation import handed_in_files
from pipeline.robot import Motion
from pipeline.sink import Result, Sink
from sarsim.assets import asset
from sarsim.commands.settings import load_settings

SHIPPED = ("league", "virtual")
"""Names of the missions that sarsim ships."""


def load_mission(name: str) -> MissionBrief:
    """The mission that ``--mission`` names: league, virtual, or a YAML file.

    Raises:
        InputError: the file cannot be read, or contains an unknown key or an invalid value.
    """
    path = asset("missions", f"{name}.yaml") if name in SHIPPED else Path(name)
    return load_settings(MissionBrief, path, flag="mission")


class League(Plugin):
    """A mission: the robot explores and looks for finds until its time is up, and the files are submitted.

    Attributes:
        brief: the mission.
    """

    Settings = LeagueConfig
    needs = ("finds",)

    def __init__(self, settings: LeagueConfig, command: Any) -> None:
        """Read the mission that the command names; ``minutes`` replaces its time limit, and ``home`` adds a task."""
        super().__init__(settings, command)
        brief = load_mission(command.mission)
        minutes = getattr(command, "minutes", None)
        goes_home = getattr(command, "home", False) and "home" not in brief.tasks
        tasks: tuple[Task, ...] = (*brief.tasks, "home") if goes_home else brief.tasks
        self.brief = replace(brief, minutes=brief.minutes if minutes is None else minutes, tasks=tasks)

    def begin(self, explorer: Explorer, time: float) -> None:
        """Start the clock; if finding is a task, the robot inspects walls after it has explored all ground."""
        brief, mission, mapper = self.brief, explorer.mission, explorer.mapper
        end, numbers = time + timedelta(minutes=brief.minutes).total_seconds(), mapper.config.exploration
        beside = brief.rewards.beside if "park" in brief.tasks else None
        mission.deadline = Deadline(
            time, end, lambda: mapper.finds.reported, "home" in brief.tasks, beside, config=numbers
        )
        explorer.watch(_Clock(end))
        if "find" in brief.tasks and mapper.readers is not None:
            mission.inspection = Inspection(
                mapper.keyframes, mapper.metric_map, config=numbers, walls=self.settings.inspection
            )

    def sinks(self, context: RunContext) -> Sequence[Sink]:
        """The sinks that submit the files and, in a simulation, score them."""
        hands_in = LeagueFiles(self.brief, config=self.settings)
        return [hands_in] if context.world is None else [hands_in, MissionScore(context.world, self.brief)]


class _Clock(Sink):
    """Ends a drive at the time ``end`` of the robot's clock, s."""

    def __init__(self, end: float):
        self._end = end

    def on_motion(self, motion: Motion) -> None:
        """Raise TimeIsUpError if no time is left."""
        if motion.time >= self._end:
            raise TimeIsUpError


class MissionScore(Sink):
    """Adds to an episode's report the scores of the files that the episode submitted."""

    finishing = "scoring the mission"

    def __init__(self, robot: Any, brief: MissionBrief):
        self._robot, self._brief = robot, brief

    def finish(self, result: Result) -> None:
        """Score the files as a judge without other data of the episode would."""
        if result.is_reported:
            result.add(mission_score(result.folder, self._robot, self._brief))


def mission_score(folder: Path, robot: Any, brief: MissionBrief) -> dict[str, Any]:
    """The leagues' scores of an episode, as returned by :func:`score_handed_in`; empty if it submitted no files.

    Nobody touches the robot, so there are no resets.
    """
    import mujoco  # a mission of a recording or of a real robot needs no simulator

    from sarsim.plugins.league.handed_in import score_handed_in, true_arena

    files = handed_in_files(folder)
    if not (files[".ply"] and files[".csv"]):
        return {}
    model = robot.physics.model.ptr
    before = mujoco.MjData(model)  # the arena before the robot moved anything
    mujoco.mj_forward(model, before)
    truth = true_arena(model, before, robot.T_world_start, robot.model, robot.base_body)
    parked = robot.trajectory[-1].T_world_base[:2, 3]
    return score_handed_in(folder, truth, brief, parked, contacts=robot.collisions.with_living)
