"""The simulated Pioneer 3-AT as a robot of ROS 2: ``ros_robot.py --arena A``."""

from rich.console import Console

from sarsim.scripts.cli import SIGNALLED, Interruptible, progress
from sarsim.scripts.settings import run_with_settings
from sarsim.settings import RosRobotConfig


def ros_robot(config: RosRobotConfig) -> None:
    """Show the simulated robot to ROS 2: it senses and obeys by topics, until Ctrl-C."""
    from pipeline.recording.live.node import Node
    from sarsim.scripts.simulated_node import SimulatedNode

    node = Node(config.name, config.network)
    try:
        simulated = SimulatedNode(config, node)
        with progress() as bars, Interruptible() as control:
            bar = bars.add_task(config.arena, total=None)
            simulated.run(lambda: control.signal is not None, lambda time: bars.update(bar, completed=round(time, 1)))
    finally:
        node.close()
    if config.out:
        Console().print(f"What is true of the drive is in {config.out}", soft_wrap=True)
    if control.signal:
        raise SystemExit(SIGNALLED + control.signal)


def main() -> None:
    """Entry point."""
    run_with_settings(ros_robot, RosRobotConfig)


if __name__ == "__main__":
    main()
