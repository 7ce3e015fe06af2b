"""Drive the robot through an arena by keyboard or gamepad, in MuJoCo's viewer: ``teleop.py --arena A``."""

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.errors import InputError
from sarsim.arenas.settings import StartPose
from sarsim.scripts.cli import Interruptible, run
from sarsim.settings import Labels

if TYPE_CHECKING:
    from sarsim.arenas.arena import RescueArena
    from sarsim.teleoperation import MappedDrive


def teleop(
    arena: str = "nist_6x4",
    start: StartPose | None = None,
    out: Path | None = None,
    labels: Labels = "truth",
    robot: str = "pioneer3at",
    gamepad: Path | None = None,
) -> None:
    """Drive the robot by keyboard or gamepad, to get to know an arena or the robot, or to map an arena by hand.

    Args:
        arena: nist_6x4, esogu_52x15, random:SEED, or the path of a .raf or MJCF file.
        start: start pose: x and y in m, yaw in degrees; by default the arena's own.
        out: folder for the recording and the maps of the drive, the same files as an episode's; Rerun shows them
            during the drive. By default nothing is mapped.
        labels: source of the points' labels if --out is given, as in run_episode.py.
        robot: pioneer3at, jackal, or the path of an MJCF file structured like theirs.
        gamepad: joystick device of Linux, such as /dev/input/js0, whose left stick drives the robot as the keys do.
    """
    from pipeline.rerun.viewer import has_display
    from sarsim.arenas.load import load_arena
    from sarsim.teleoperation import KEYS, FreeDrive, Gamepad, drive_by_keyboard

    scene, pad = load_arena(arena, start), Gamepad(gamepad) if gamepad else None
    if not has_display():
        raise InputError("there is no display for MuJoCo's viewer (neither DISPLAY nor WAYLAND_DISPLAY is set)")
    mapped = map_drive(scene, out, labels, robot) if out else None
    driven = mapped or FreeDrive(scene, robot)
    print(KEYS, flush=True)
    with Interruptible() as hold:
        drive_by_keyboard(driven, lambda: hold.signal is not None, pad)
        if mapped and out:
            mapped.save(out)
            print(f"{len(mapped.mapper.keyframes)} keyframes in {out}", flush=True)
    if hold.signal is not None:
        raise KeyboardInterrupt(hold.signal)


def map_drive(arena: "RescueArena", out: Path, labels: Labels, robot: str) -> "MappedDrive":
    """A drive that is mapped and recorded; InputError if the folder, the labels or the viewer are not available."""
    from pipeline.files import check_folder, make_folder
    from pipeline.rerun.viewer import Viewer
    from sarsim.perception import make_classifier
    from sarsim.recording import EpisodeRecorder
    from sarsim.simulated_robot import SimulatedRobot, SimulationConfig
    from sarsim.teleoperation import MappedDrive

    check_folder(out)
    classifier = make_classifier(labels, None)
    body, viewer = SimulatedRobot(arena, SimulationConfig(robot=robot), seed=0), Viewer("spawn")
    make_folder(out)
    return MappedDrive(body, classifier, EpisodeRecorder(body, out / "episode.rrd", viewer))


def main() -> None:
    """Entry point."""
    run(teleop)


if __name__ == "__main__":
    main()
