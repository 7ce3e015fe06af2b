"""The programs for real robots and recordings run without a simulator."""

import subprocess
import sys
from pathlib import Path

from tests.pipeline.datasets.recorded_room import write_bag

PROGRAM = """
import sys
from contextlib import suppress
from pathlib import Path
from sarsim.commands import map_recording, ros_explore
from sarsim.commands.ros_drive import RosDrive
from sarsim.settings import RosExploration
from tests.pipeline.plugins.ros.live.loopback import End, RoomRobot, Wire

explored, mapped, room = map(Path, sys.argv[1:])
for command in map_recording, ros_explore:
    sys.argv[1:] = ["--help"]
    with suppress(SystemExit):
        command.main()

sys.argv[1:] = [str(room), "--out", str(mapped), "--labels", "rules", "--detector", "None"]
map_recording.main()

wire = Wire()
robot, end = RoomRobot(wire), End(wire, "explorer")
end.work = robot.period
drive = RosDrive(RosExploration(out=explored, steps=1, labels="rules", detector=None), end)
assert drive.run() and drive.report["steps"] == 1

simulators = "mujoco", "dm_control", "dm_env", "sarsim.simulated_robot", "sarsim.task", "sarsim.sensors"
print("imported:", [name for name in simulators if name in sys.modules])
"""
"""Asks for help, maps a recording and explores with a robot, in one process, whose imports are the expensive part."""


def test_a_real_robots_programs_import_no_simulator(tmp_path: Path) -> None:
    folders = [tmp_path / "explored", tmp_path / "mapped"]
    words = [*folders, write_bag(tmp_path / "room")]
    done = subprocess.run([sys.executable, "-c", PROGRAM, *words], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "imported: []"
    assert all((folder / "report.html").exists() for folder in folders)
