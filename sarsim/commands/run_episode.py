"""Run an episode: the robot explores an arena, builds its maps and writes a recording and a report."""

import shutil
from typing import TYPE_CHECKING

from pipeline.errors import InputError
from pipeline.files import check_folder
from sarsim.assets import asset
from sarsim.commands.cli import announce_compilation, exit_by_signal, is_verbose, run_watched
from sarsim.commands.settings import run_with_settings, save_settings
from sarsim.commands.tables import show_results
from sarsim.compilation import compile_on_two_cores
from sarsim.opengl import check_rendering
from sarsim.settings import POINT_NETWORKS, EpisodeConfig

if TYPE_CHECKING:
    from sarsim.commands.network_cache import OutputCache
    from sarsim.episode import Episode


def run_episode(config: EpisodeConfig) -> None:
    """Explore an arena, and write a recording, a report and maps. To repeat it, pass its config.yaml to --config."""
    if config.resume and config.out:
        raise InputError(f"--resume {config.resume}: cannot be combined with --out, as it writes to its own folder")
    if config.resume and config.map and config.map.resolve() == config.resume.resolve():
        raise InputError(f"--resume {config.resume}: --map must not name the same folder")
    check_folder(config.folder, config.marks)
    check_rendering()
    from sarsim.episode import Episode  # imported here, because it takes seconds

    announce_compilation()
    compile_on_two_cores()
    episode = Episode(config)
    config = episode.config
    save_settings(config, config.folder / "config.yaml")
    cache = cache_outputs(episode)
    ended_by = run_watched(episode.run, config.arena)
    if not ended_by:
        shutil.rmtree(cache.folder)
    if config.resume:
        print(f"Repeated the episode from the start, reusing {cache.hits} stored network outputs")
    show_results(episode.report, config.folder, is_verbose())
    exit_by_signal(ended_by)
    if (viewer := episode.recorder.viewer) and viewer.was_opened:
        print("Press Ctrl-C to close the live view", flush=True)
        viewer.wait()


def cache_outputs(episode: "Episode") -> "OutputCache":
    """Cache the outputs of an episode's networks in its folder, so that a resumed episode can reuse the outputs."""
    from sarsim.commands.network_cache import CachedClassifier, CachedDetector, OutputCache

    config, mapper = episode.config, episode.explorer.mapper
    cache = OutputCache(config.folder / "network_outputs")
    if config.labels in POINT_NETWORKS:
        weights = config.weights or asset("weights", f"{config.labels}.safetensors")
        mapper.classifier = CachedClassifier(mapper.classifier, cache, weights)
    if mapper.detector and config.detector and not config.detector_class:
        names = (config.detector_names,) if config.detector_names else ()
        mapper.detector = CachedDetector(mapper.detector, cache, *config.detector, *names)
    return cache


def main() -> None:
    """Entry point of ``sarsim-episode``."""
    run_with_settings(run_episode, EpisodeConfig)
