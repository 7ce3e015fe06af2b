"""The simulated robot as a ROS 2 robot: ``ros_robot.py --arena A``."""

from contextlib import closing

from rich.console import Console

from pipeline.errors import require_package
from pipeline.progress import Progress
from sarsim.commands.cli import exit_by_signal, run_watched
from sarsim.commands.settings import run_with_settings
from sarsim.opengl import check_rendering
from sarsim.plugins.ros.settings import RosRobotConfig


def ros_robot(config: RosRobotConfig) -> None:
    """Run the simulated robot as a ROS 2 robot that publishes sensor data and follows commands until Ctrl-C."""
    check_rendering()
    require_package("rosbags", "bags", "a robot on a ROS 2 network")
    from pipeline.plugins.ros.live.node import RosNode
    from sarsim.plugins.ros.simulated_node import SimulatedNode

    with closing(RosNode(config.name, config.network, config=config.ros.live)) as node:
        simulated = SimulatedNode(config, node)
        ended_by = run_watched(
            lambda interrupted, show: simulated.run(
                interrupted, lambda time: show(Progress(f"{config.arena}: {time:.1f} s simulated"))
            ),
            config.arena,
        )
    if config.out:
        Console(markup=False).print(f"Ground truth of the drive: {config.out}", soft_wrap=True)
    exit_by_signal(ended_by)


def main() -> None:
    """Entry point of ``sarsim-ros-robot``."""
    run_with_settings(ros_robot, RosRobotConfig)
