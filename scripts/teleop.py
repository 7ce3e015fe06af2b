"""Drive the robot through an arena by keyboard, in MuJoCo's viewer: ``teleop.py --arena A``."""

from pipeline.errors import InputError
from pipeline.viewer import has_display
from sarsim.arenas.load import load_arena
from sarsim.scripts.cli import run
from sarsim.task import rescue_environment
from sarsim.teleoperation import KEYS, drive_by_keyboard


def teleop(arena: str = "nist_6x4") -> None:
    """Drive the robot by keyboard.

    Args:
        arena: nist_6x4, or the path of an MJCF file.
    """
    environment = rescue_environment(load_arena(arena), seed=0)
    if not has_display():
        raise InputError(
            "there is no display for MuJoCo's viewer (neither DISPLAY nor WAYLAND_DISPLAY is set)"
        )
    print(KEYS, flush=True)
    drive_by_keyboard(environment)


def main() -> None:
    """Entry point."""
    run(teleop)


if __name__ == "__main__":
    main()
