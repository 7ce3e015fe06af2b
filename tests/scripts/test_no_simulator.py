"""The programs for real robots and recordings run without a simulator."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.pipeline.datasets.recorded_room import write_bag

EXPLORE = """
import sys
from pathlib import Path
from sarsim.scripts.ros_drive import RosDrive
from sarsim.settings import RosExploration
from tests.pipeline.ros.live.loopback import End, RoomRobot, Wire

wire = Wire()
room, end = RoomRobot(wire), End(wire, "explorer")
end.work = room.period
drive = RosDrive(RosExploration(out=Path(sys.argv[1]), steps=1, labels="rules", detector=None), end)
assert drive.run() and drive.report["steps"] == 1
"""
MAP = """
import sys
from sarsim.scripts.map_recording import main

sys.argv[1:] = [sys.argv[2], "--out", sys.argv[1], "--labels", "rules", "--detector", "None"]
main()
"""
HELP = """
import sys
from contextlib import suppress
from sarsim.scripts.{0} import main

sys.argv[1:] = ["--help"]
with suppress(SystemExit):
    main()
"""
SIMULATORS = """
simulators = "mujoco", "dm_control", "dm_env", "sarsim.simulated_robot", "sarsim.task", "sarsim.sensors"
print("imported:", [name for name in simulators if name in sys.modules])
"""


@pytest.mark.parametrize("program", [EXPLORE, MAP, HELP.format("ros_explore"), HELP.format("map_recording")])
def test_a_real_robots_program_imports_no_simulator(program: str, tmp_path: Path) -> None:
    words = [tmp_path / "out", write_bag(tmp_path / "room")] if program in (EXPLORE, MAP) else []
    done = subprocess.run(
        [sys.executable, "-c", program + SIMULATORS, *words], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "imported: []"
    assert (tmp_path / "out" / "report.html").exists() == bool(words)
