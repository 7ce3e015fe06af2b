"""One episode of the exploration's benchmark: run in a process of its own, kept as one JSON file and one picture."""

import json
import tempfile
import traceback
from contextlib import redirect_stderr
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.exploration.baselines import NearestFrontier, RandomWalk
from pipeline.files import whole_file
from pipeline.navigation.navigator import Outcome
from sarsim.scoring.episode import MOST
from sarsim.scripts.benchmarks.top_view import top_view
from sarsim.scripts.run_episode import Episode, EpisodeConfig
from sarsim.simulated_robot import Pose

Strategy = Literal["ours", "nearest_frontier", "random_walk"]


@dataclass(frozen=True)
class Job:
    """An episode to run.

    Attributes:
        group: of arenas that it belongs to.
        strategy: that chooses where to look.
        config: of the episode; its folder is not used.
    """

    group: str
    strategy: Strategy
    config: EpisodeConfig

    @property
    def name(self) -> str:
        """Of its files."""
        arena = Path(self.config.arena).stem.replace(":", "_")
        return f"{self.strategy}-{arena}-{self.config.seed}"

    @property
    def settings(self) -> dict[str, Any]:
        """All that its result depends on, as JSON knows it."""
        told = {"group": self.group, "strategy": self.strategy, "config": asdict(self.config)}
        return json.loads(json.dumps(told | {"version": version("sarsim")}, default=str))

    def result(self, folder: Path) -> dict[str, Any] | None:
        """What an earlier run left; None if there is nothing.

        Raises:
            InputError: it left something else.
        """
        file = folder / f"{self.name}.json"
        if not file.exists():
            return None
        try:
            content = json.loads(file.read_text())
            if content["settings"] == self.settings:
                return content
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{file}: not an episode's result: {error}") from error
        raise InputError(f"{file}: has been run with other settings; give another folder with --runs")


class BenchmarkEpisode(Episode):
    """An episode with one of the strategies, which remembers where the robot touched something.

    Attributes:
        contacts: (2,) m where it was then.
    """

    def __init__(self, job: Job, out: Path):
        super().__init__(replace(job.config, out=out))
        if job.strategy == "nearest_frontier":
            self.explorer.exploration = NearestFrontier(self.robot.model)
        elif job.strategy == "random_walk":
            self.explorer.exploration = RandomWalk(self.robot.model, job.config.seed)
        self._aimless = job.strategy == "random_walk"
        self.contacts: list[NDArray[np.float64]] = []
        self._collisions = self.robot.collisions.collisions
        self._log_motion = self.robot.on_motion
        self.robot.on_motion = self._watch

    def step(self) -> bool:
        """One look and the drive to the next; a walk that knows no aim ends when ``MOST`` was seen."""
        return super().step() and not (self._aimless and self.score.explored_fraction >= MOST)

    def _watch(self, pose: Pose) -> None:
        self._log_motion(pose)
        if self.robot.collisions.collisions > self._collisions:
            self._collisions = self.robot.collisions.collisions
            self.contacts.append(pose.T_world_base[:2, 3])

    def picture(self) -> NDArray[np.uint8]:
        """The run from above."""
        way = np.array([pose.T_world_base[:2, 3] for pose in self.robot.trajectory])
        failed = [leg.target for leg in self.explorer.navigator.legs if leg.outcome is not Outcome.REACHED]
        end = self.score.progress[-1][0]
        text = (
            f"{Path(self.config.arena).name}, seed {self.config.seed}:"
            f" {self.score.explored_fraction:.1%} seen in {end:.0f} s,"
            f" {self.explorer.steps} looks, {len(self.contacts)} contacts, {len(failed)} legs not reached"
        )
        return top_view(self.score.surface, self.score.seen, way, self.contacts, failed, text)


def run_job(job: Job, folder: Path) -> None:
    """Run an episode and leave its JSON and its picture in a folder; what it says goes to a log beside them."""
    with (folder / f"{job.name}.log").open("w") as log, redirect_stderr(log):
        try:
            _run(job, folder)
        except Exception:
            traceback.print_exc()
            raise SystemExit(1) from None


def _run(job: Job, folder: Path) -> None:
    with tempfile.TemporaryDirectory(prefix="sarsim-") as out:
        try:
            episode = BenchmarkEpisode(job, Path(out))
        except InputError as error:
            _keep({"settings": job.settings, "left_out": str(error)}, folder, job)
            return
        finished = episode.run()
    if finished:
        picture = cv2.cvtColor(episode.picture(), cv2.COLOR_RGB2BGR)
        cv2.imwrite(str(folder / f"{job.name}.png"), picture)
        errors = episode.score.position_errors
        _keep({"settings": job.settings, "report": episode.report, "position_errors": errors}, folder, job)


def _keep(content: dict[str, Any], folder: Path, job: Job) -> None:
    with whole_file(folder / f"{job.name}.json") as file:
        file.write_text(json.dumps(content, indent=1, default=float, allow_nan=False) + "\n")
