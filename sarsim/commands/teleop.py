"""Drive the robot through an arena by keyboard or gamepad, in MuJoCo's viewer: ``teleop.py --arena A``."""

from pipeline.errors import InputError
from pipeline.files import check_folder
from sarsim.commands.cli import SignalRecorder
from sarsim.commands.settings import run_with_settings
from sarsim.opengl import check_display, check_rendering, without_opengl
from sarsim.settings import TeleopConfig


def teleop(config: TeleopConfig) -> None:
    """Drive the robot with the keyboard or a gamepad, to explore an arena yourself or to map it by hand."""
    own = {"sink": config.sink, "reader": config.reader}
    of_mapping = [f"{flag} {name}" for flag, names in own.items() for name in names] + list(config.plugins)
    if config.out:
        check_folder(config.out)
        check_rendering()
    elif of_mapping:
        raise InputError(f"--{of_mapping[0]}: requires --out, without which the robot only drives")
    with without_opengl():
        from sarsim.methods.arena import make_arena
        from sarsim.teleoperation import KEYS, FreeDrive, Gamepad, MappedDrive, drive_by_keyboard

    arena = make_arena(config.arena, config.start)
    pad = Gamepad(config.gamepad) if config.gamepad else None
    check_display()
    mapped = MappedDrive(config, arena, config.out, is_shown=True) if config.out else None
    driven = mapped or FreeDrive(arena, config.robot)
    print(KEYS, flush=True)
    with SignalRecorder() as hold:
        try:
            drive_by_keyboard(driven, lambda: hold.signal is not None, pad)
        finally:
            if mapped:
                mapped.save()
                print(f"Mapped {len(mapped.mapper.keyframes)} keyframes; results in {config.out}", flush=True)
    if hold.signal is not None:
        raise KeyboardInterrupt(hold.signal)


def main() -> None:
    """Entry point of ``sarsim-teleop``."""
    run_with_settings(teleop, TeleopConfig)
