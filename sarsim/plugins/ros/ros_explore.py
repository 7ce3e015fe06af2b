"""Explore with a ROS 2 robot: ``ros_explore.py --out DIR``."""

from contextlib import closing

from pipeline.errors import require_package
from sarsim.commands.cli import exit_by_signal, is_verbose, run_watched
from sarsim.commands.settings import run_with_settings, save_settings
from sarsim.commands.tables import show_results
from sarsim.plugins.ros.settings import RosExplorationConfig


def ros_explore(config: RosExplorationConfig) -> None:
    """Explore with a robot on a ROS 2 network, and write the files of an episode.

    Ctrl-C stops the robot. If the robot goes silent or ignores commands, the maps built so far are kept.
    """
    require_package("rosbags", "bags", "a robot on a ROS 2 network")
    from pipeline.plugins.ros.live.node import RosNode
    from sarsim.plugins.ros.ros_drive import RosDrive

    with closing(RosNode(config.name, config.network, config=config.ros.live)) as node:
        drive = RosDrive(config, node)
        save_settings(config, config.out / "config.yaml")
        ended_by = run_watched(drive.run, config.out.name)
    show_results(drive.report, config.out, is_verbose())
    exit_by_signal(ended_by)


def main() -> None:
    """Entry point of ``sarsim-ros-explore``."""
    run_with_settings(ros_explore, RosExplorationConfig)
