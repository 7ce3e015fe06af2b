"""Drive the robot through an arena by keyboard, in MuJoCo's viewer: ``teleop.py --arena A``."""

from pipeline.errors import InputError
from sarsim.arenas.settings import StartPose
from sarsim.scripts.cli import Interruptible, run


def teleop(arena: str = "nist_6x4", start: StartPose | None = None) -> None:
    """Drive the robot by keyboard, to get to know an arena or the robot.

    Args:
        arena: nist_6x4, esogu_52x15, random:SEED, or the path of a .raf or MJCF file.
        start: where the robot begins: x and y in m, yaw in degrees; by default where the arena says.
    """
    from pipeline.recording.viewer import has_display
    from sarsim.arenas.load import load_arena
    from sarsim.task import rescue_environment
    from sarsim.teleoperation import KEYS, drive_by_keyboard

    environment = rescue_environment(load_arena(arena, start), seed=0)
    if not has_display():
        raise InputError("there is no display for MuJoCo's viewer (neither DISPLAY nor WAYLAND_DISPLAY is set)")
    print(KEYS, flush=True)
    with Interruptible() as hold:
        drive_by_keyboard(environment, lambda: hold.signal is not None)
    if hold.signal is not None:
        raise KeyboardInterrupt(hold.signal)


def main() -> None:
    """Entry point."""
    run(teleop)


if __name__ == "__main__":
    main()
