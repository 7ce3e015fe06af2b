"""Processor time of complete episodes, by stage and over all threads, and relative to the simulated world alone.

For the time of the world alone, the commands and image requests of the same drive are replayed without the robot's
software. A short episode runs first, so that imports and the compilation of kernels are not measured.
"""

import gc
import re
import sys
import tempfile
import threading
import time
from collections import defaultdict
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import Any, Self

import numpy as np

import pipeline
from pipeline.errors import InputError, required
from pipeline.robot import Motion, Velocity
from pipeline.sink import Step
from sarsim.commands.cli import tracked
from sarsim.episode import Episode
from sarsim.methods.arena import make_arena
from sarsim.settings import EpisodeConfig
from sarsim.simulated_robot import SimulatedRobot
from scripts.benchmarks.common import Result, check_at_least
from scripts.benchmarks.settings import CostSettings

CODE_FOLDER = Path(pipeline.__file__).parents[1]
SAMPLE_PERIOD = 0.005  # s, time between two samples
STAGES = {
    "pipeline/victims/detector.py": "detector",
    "pipeline/victims/two_stages.py": "detector",
    "pipeline/victims/yolo.py": "detector",
    "pipeline/victims/boxes.py": "detector",
    "pipeline/victims/input_image.py": "detector",
    "pipeline/plugins/finds": "finds",
    "pipeline/tracks/finds.py": "finds",
    "pipeline/tracks/objects.py": "finds",
    "pipeline/victims": "people",
    "pipeline/semantic_map/networks": "labels",
    "pipeline/semantic_map": "semantic_map",
    "pipeline/localisation": "localisation",
    "pipeline/metric_map": "metric_map",
    "pipeline/elevation_map": "elevation_map",
    "pipeline/segments": "segments",
    "pipeline/topological_map": "topological_map",
    "pipeline/exploration": "exploration",
    "pipeline/planning": "planning",
    "pipeline/navigation": "navigation",
    "pipeline/rerun": "recording",
    "pipeline/rescue_report": "results",
    "pipeline/plugins/league": "results",
    "pipeline/map_file.py": "results",
    "pipeline/results.py": "results",
    "pipeline/keyframes.py": "keyframes",
    "sarsim/recording.py": "recording",
    "sarsim/scoring": "scores",
    "sarsim/plugins": "scores",
    "sarsim/ground_truth": "scores",
    "sarsim/sensors": "images",
    "sarsim/arenas/things": "images",
    "sarsim/environment.py": "physics",
    "sarsim/robots": "physics",
    "sarsim/simulated_robot.py": "physics",
}
"""Stage by path of the innermost running code; code that is not listed belongs to its caller's stage."""


def measure(settings: CostSettings) -> Result:
    """Processor time of an episode in each arena, in total and by stage, and of the episode's world alone.

    Raises:
        InputError: there is no arena, or an arena cannot be loaded.
    """
    check_at_least(0, settings, "seed")
    if not settings.arenas:
        raise InputError("--arenas: give at least one arena")
    figures = dict[str, float]()
    with tempfile.TemporaryDirectory() as name:
        Episode(EpisodeConfig(arena=settings.arenas[0], steps=1, out=Path(name, "first"))).run(show_progress=False)
        for number, arena in enumerate(tracked(settings.arenas, "arenas")):
            out = Path(name, str(number))
            plugins = {"finds": None} if settings.finds else {}
            config = EpisodeConfig(arena=arena, seed=settings.seed, steps=settings.steps, out=out, plugins=plugins)
            gc.collect()  # the maps of the last episode are in reference cycles
            figures |= {f"{arena}.{key}": value for key, value in _cost(config).items()}
    return Result(figures)


def _cost(config: EpisodeConfig) -> dict[str, float]:
    """The figures of an episode."""
    # Run the episode, record its commands and image requests, and sample its running code.
    reset_peak_memory()
    episode = Episode(config)
    drive, steps = Drive(episode.robot), StepTimes(episode)
    with Sampler() as sampler:
        episode.run(show_progress=False)
    peak = peak_memory()
    # Replay the same drive in the world alone.
    world, total = drive.replay(config), sum(sampler.seconds.values())
    by_size = sorted(sampler.seconds.items(), key=lambda item: -item[1])
    return {
        "over_world": total / world,
        "processor_s": total,
        "world_s": world,
        "real_time_factor": episode.report["real_time_factor"],
        "peak_gb": peak,
        **{f"share.{stage}": seconds / total for stage, seconds in by_size},
        **steps.figures(),
    }


def reset_peak_memory() -> None:
    """Let :func:`peak_memory` start again from the memory that this process uses now; see Linux's proc(5)."""
    with suppress(OSError):  # some sandboxes lack the file; the peak then includes earlier episodes
        Path("/proc/self/clear_refs").write_text("5")


def peak_memory() -> float:
    """Maximum memory that this process has used, GB."""
    status = Path("/proc/self/status").read_text()
    return int(re.findall(r"VmHWM:\s*(\d+) kB", status)[0]) * 1024 / 1e9


class Drive:
    """Records the commands given to a robot and the images requested from it, in order."""

    def __init__(self, robot: SimulatedRobot):
        self._requests: list[Velocity | None] = []
        self._config = robot.config
        drive, sense = robot.drive, robot.sense

        def noted_drive(command: Velocity) -> Motion:
            self._requests.append(command)
            return drive(command)

        def noted_sense() -> Any:
            self._requests.append(None)
            return sense()

        robot.drive, robot.sense = noted_drive, noted_sense  # type: ignore[method-assign]

    def replay(self, config: EpisodeConfig) -> float:
        """Replay only the commands and image requests, and return their processor time, s."""
        arena = make_arena(config.arena, config.start, config.random, config.seed)
        robot = SimulatedRobot(arena, self._config, config.seed)
        begin = time.process_time()
        for command in self._requests:
            if command is None:
                robot.sense()
            else:
                robot.drive(command)
        seconds = time.process_time() - begin
        robot.close()
        return seconds


class StepTimes:
    """Wall-clock time of each step, from image to plan, with the number of keyframes after the step."""

    def __init__(self, episode: Episode):
        self._times = list[tuple[int, float]]()
        explorer, step = episode.explorer, episode.explorer.step

        def timed_step() -> Step:
            begin = time.perf_counter()
            result = step()
            self._times.append((len(explorer.mapper.keyframes), time.perf_counter() - begin))
            return result

        explorer.step = timed_step  # type: ignore[method-assign]

    def figures(self) -> dict[str, float]:
        """Median step time, ms, at around 100 and 1,000 keyframes, if the run had that many."""
        found = {}
        for count in (100, 1000):
            near = [1e3 * seconds for keyframes, seconds in self._times if 0.8 * count < keyframes < 1.2 * count]
            if near and self._times[-1][0] >= count:
                found[f"step_ms.{count}"] = float(np.median(near))
        return found


class Sampler:
    """Samples the stage of every Python thread of this process, weighted by the thread's processor time.

    Attributes:
        seconds: processor time by stage, s; the stage of library threads that run no Python is ``native``.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._ended, self._thread = threading.Event(), threading.Thread(target=self._sample, daemon=True)

    def __enter__(self) -> Self:
        self._begin = time.process_time()
        self._clocks = {thread: _processor_time(thread) for thread in threading.enumerate()}
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        self.seconds["native"] = time.process_time() - self._begin - self._own - sum(self.seconds.values())

    def _sample(self) -> None:
        while not self._ended.wait(SAMPLE_PERIOD):
            frames = sys._current_frames()
            for thread in threading.enumerate():
                if thread is not self._thread and thread.ident in frames:
                    before = self._clocks.get(thread, 0.0)
                    now = self._clocks[thread] = max(before, _processor_time(thread))
                    self.seconds[stage_of(frames[thread.ident])] += now - before
        self._own = time.thread_time()


def _processor_time(thread: threading.Thread) -> float:
    """Processor time, s, that a thread has used so far; 0 if the thread has just ended."""
    try:
        # Linux's CPU clock of a thread id; pthread_getcpuclockid may crash if the thread has ended.
        return time.clock_gettime((~required(thread.native_id) << 3) | 6)
    except OSError:
        return 0.0


def stage_of(frame: FrameType | None) -> str:
    """The stage of a thread, according to its innermost stack frame with a listed path."""
    while frame is not None:
        path = Path(frame.f_code.co_filename)
        if path.is_relative_to(CODE_FOLDER):
            place = path.relative_to(CODE_FOLDER)
            for part in (place, *place.parents):
                if stage := STAGES.get(part.as_posix()):
                    return stage
        frame = frame.f_back
    return "other"
