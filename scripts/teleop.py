"""Drive the robot through an arena by keyboard, in MuJoCo's viewer: ``teleop.py --arena A``."""

from pipeline.errors import InputError
from pipeline.recording.viewer import has_display
from sarsim.arenas.load import StartPose, load_arena
from sarsim.arenas.random_arena import RandomArenaConfig
from sarsim.scripts.cli import run
from sarsim.task import rescue_environment
from sarsim.teleoperation import KEYS, drive_by_keyboard

_DEFAULT = RandomArenaConfig()


def teleop(
    arena: str = "nist_6x4", start: StartPose | None = None, random: RandomArenaConfig = _DEFAULT
) -> None:
    """Drive the robot by keyboard.

    Args:
        arena: nist_6x4, esogu_52x15, random:SEED, or the path of a .raf or MJCF file.
        start: where the robot is set down: x and y in m, yaw in degrees.
        random: what a random arena is like.
    """
    environment = rescue_environment(load_arena(arena, start, random), seed=0)
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
