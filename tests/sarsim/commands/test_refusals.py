"""What a command cannot do it refuses in one line, with exit status 2, and leaves nothing behind."""

import json
import os
import pickle
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from sarsim.assets import asset
from tests.pipeline.victims.networks import SMALL
from tests.sarsim.rooms import room
from tests.source_tree import ROOT

HEAVY = ("mujoco", "dm_control", "torch", "numba", "scipy", "cv2", "h5py", "rerun")
BEFORE_IMPORTS = [
    ("run_episode", "--arena nist_9x9", "nist_6x4"),
    ("run_episode", "--arena random:x", "random:x"),
    ("run_episode", "--arena none.sdf", "none.sdf"),
    ("run_episode", "--arena nowhere:build", "nowhere"),
    ("run_episode", "--robot r2d2", "jackal"),
    ("run_episode", "--robot none.xml", "none.xml"),
    ("run_episode", "--exploration nearest", "nearest_frontier"),
    ("run_episode", "--exploration nowhere.at.all:Nearest", "nowhere"),
    ("run_episode", "--exploration :Nearest", ":Nearest"),
    ("run_episode", "--labels pointnext2", "pointnext"),
    ("run_episode", "--localisation gps", "odometry"),
    ("run_episode", "--planner rrt", "topological"),
    ("run_episode", "--detector-class mine", "MODULE:CLASS"),
    ("run_episode", "--reader nowhere:Reader", "nowhere"),
    ("run_episode", "--weights none.safetensors", "none.safetensors"),
    ("run_episode", "--detector none.cfg none.weights", "none.cfg"),
    ("run_episode", "--no-detector --detector none.onnx", "--no-detector: cannot be combined with --detector"),
    ("run_episode", "--no-detector --detector-class a:B", "--no-detector: cannot be combined with --detector-class"),
    ("run_episode", "--map none", "--map none"),
    ("run_episode", "--camera-size 4 3", "--camera-size 4 3: "),
    ("run_episode", "--camera-size 640 48", "--camera-size 640 48: "),
    ("run_episode", "--camera-size 64000 48000", "--camera-size 64000 48000: "),
    ("run_episode", "--out full", "full: contains an earlier run"),
    ("run_episode", "--out=", "--out=: the value must not be empty"),
    ("run_episode", "--goals 1 2 nan 0", "--goals 1 2 nan 0:"),
    ("run_episode", "--goals 1 2 3", "--goals"),
    ("run_episode", "--steps 0", "--steps 0"),
    ("run_episode", "--speed nan", "--speed nan"),
    ("run_episode", "--minutes 5", "--mission"),
    ("run_episode", "--mission league --minutes 0", "--minutes 0:"),
    ("run_episode", "--mission league --minutes inf", "--minutes inf:"),
    ("run_episode", "--resume none", "--resume none: no such folder"),
    ("run_episode", "--resume .", "--resume .: has no config.yaml"),
    ("map_recording", "none --out a", "none: no such file or folder"),
    ("map_recording", ". --out a --labels pointnext2", "pointnext"),
    ("map_recording", ". --out a --poses guess", "--poses"),
    ("teleop", "--arena nist_9x9", "nist_6x4"),
    ("export_arena", "--arena nist_9x9 --out a.xml", "nist_6x4"),
    ("score_mission", ". --arena nist_9x9", "nist_6x4"),
    ("sweep", "--methods nearest", "nearest_frontier"),
    ("sweep", "--arenas nist_9x9", "nist_6x4"),
    ("sweep", "--camera-size 0 0", "--camera-size 0 0: "),
    ("generate_dataset", "--arenas nist_6x4 nist_9x9 --out a", "esogu_52x15"),
    ("generate_dataset", "--scenes 0 --out a", "--scenes"),
    ("generate_dataset", "--workers 0 --out a", "--workers"),
    ("generate_dataset", "--engine cloud --out a", "--engine"),
    ("view", "none.rrd", "none.rrd"),
    ("view", "full", "full/episode.rrd"),
    ("view", "full/report.json", "report.json: not a Rerun recording; give an .rrd file"),
    ("train", "pointnext3 --data . --out a.safetensors", "pointnext"),
    ("train", "pointnext --data none --out a.safetensors", "--data none"),
    ("train", "pointnext --data . --init none --out a.safetensors", "--init none"),
    ("train", "dgcnn", "--data"),
    ("train", "dgcnn --data . --out none/w.safetensors", "none"),
    ("train", "dgcnn --data . --out w.csv", "end in .safetensors"),
]
PROGRAM = f"""
import contextlib, importlib, io, json, sys
answers = []
for name, line, _ in {BEFORE_IMPORTS!r}:
    sys.argv = [name, *line.split()]
    said = io.StringIO()
    with contextlib.redirect_stderr(said):
        try:
            importlib.import_module("scripts." + name).main()
        except SystemExit as ended:
            status = ended.code
    answers.append((status, said.getvalue(), [module for module in {HEAVY!r} if module in sys.modules]))
print(json.dumps(answers))
"""


def test_what_is_wrong_at_first_sight_is_refused_before_what_is_slow_is_imported(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "report.json").write_text("PK")
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", PROGRAM]
    run = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=True)
    for (name, line, hint), (status, said, heavy) in zip(BEFORE_IMPORTS, json.loads(run.stdout), strict=True):
        assert (status, said.count("\n"), heavy) == (2, 1, []), (name, line, said)
        assert hint in said, (name, line, said)
    assert run.stderr == ""
    assert [path.name for path in tmp_path.iterdir()] == ["full"]


BOMB = """<!DOCTYPE m [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>"""
IN_A_WALL = """<mujoco><size nuser_geom="1"/><worldbody><site name="start"/><geom type="plane" size="3 3 1" user="2"/>
<geom type="box" size="0.5 0.5 0.5" user="1"/></worldbody></mujoco>"""
FILES = {
    "small.xml": room((-0.6, 1.4), (-0.8, 0.8)),
    "cut.xml": "<mujoco><worldbody>",
    "robot.xml": "<robot/>",
    "empty_geom.xml": "<mujoco><worldbody><geom/></worldbody></mujoco>",
    "bomb.xml": f'{BOMB}<mujoco model="&b;"><worldbody/></mujoco>',
    "no_floor.xml": '<mujoco><worldbody><site name="start"/><geom size="0.1" pos="9 9 9"/></worldbody></mujoco>',
    "in_a_wall.xml": IN_A_WALL,
    "label.xml": IN_A_WALL.replace('user="1"', 'user="11"').replace("0.5 0.5 0.5", "0.1 0.1 0.1"),
    "cut.raf": "<elements><element",
    "bomb.raf": f"{BOMB}<elements>&b;</elements>",
    "unknown.raf": '<elements><element type="xwall" x="0" y="0" rotation="0"/></elements>',
    "map.yaml": "image: none.pgm\nresolution: 1\norigin: [0, 0, 0]",
    "gru.cfg": SMALL + "[gru]\n",
    "gru.weights": "\0" * 300,
    "net.cfg": SMALL,
    "long.weights": "\0" * 3000,
    "mine.py": "class Bad:\n    pass\n",
    "wheels.yaml": "wheels: 4",
    "dance.yaml": "tasks: [dance]",
    "soon.yaml": "minutes: soon",
    "never.yaml": "minutes: 0",
    "earlier/config.yaml": "seed: 3\n",
    "forged/config.yaml": "resume: /tmp/else\n",
}
EPISODE = "--labels truth --detector None --arena small.xml --out out"
POINTNEXT = asset("weights", "pointnext.safetensors")
LATE = [
    ("run_episode", f"{EPISODE} --arena cut.xml", "cannot be parsed as XML: "),
    ("run_episode", f"{EPISODE} --arena robot.xml", "is URDF"),
    ("run_episode", f"{EPISODE} --arena bomb.xml", "declares a document type"),
    ("run_episode", f"{EPISODE} --arena no_floor.xml", "no free ground at (0, 0) m; choose another start"),
    ("run_episode", f"{EPISODE} --arena in_a_wall.xml", " m; choose a free place with --start X Y YAW"),
    ("run_episode", f"{EPISODE} --arena label.xml", "user=11"),
    ("run_episode", f"{EPISODE} --seed -1", "--seed -1"),
    ("run_episode", f"{EPISODE} --fiducials 99", "--fiducials 99"),
    ("run_episode", f"{EPISODE} --out /dev/null/x", "/dev/null/x"),
    ("run_episode", f"{EPISODE} --labels dgcnn --weights {POINTNEXT}", "weights of 'pointnext', but must contain"),
    ("run_episode", f"{EPISODE} --labels dgcnn --weights pickle.safetensors", "a pickle file can run code"),
    ("run_episode", f"{EPISODE} --detector gru.cfg gru.weights", "gru"),
    ("run_episode", f"{EPISODE} --detector net.cfg gru.weights", "too short"),
    ("run_episode", f"{EPISODE} --detector net.cfg long.weights", "too long"),
    ("run_episode", f"{EPISODE} --sink mine:Bad --bag bag --tum tum", "--sink mine:Bad"),
    ("run_episode", f"{EPISODE} --view spawn", "display"),
    ("run_episode", "--mission none.yaml", "none.yaml"),
    ("run_episode", "--mission wheels.yaml", "unknown setting wheels"),
    ("run_episode", "--mission dance.yaml", "tasks"),
    ("run_episode", "--mission soon.yaml", "minutes"),
    ("run_episode", "--mission never.yaml", "minutes"),
    ("run_episode", "--resume earlier --out x", "--out"),
    ("run_episode", "--resume earlier --map earlier", "--map"),
    ("run_episode", "--resume earlier --config x.yaml", "--config x.yaml"),
    ("run_episode", "--resume forged", "--resume as a flag"),
    ("teleop", "", "DISPLAY"),
    ("teleop", "--gamepad /dev/input/js99", "No such file"),
    ("teleop", "--gamepad mine.py", "must be a joystick device"),
    ("teleop", "--sink mine:Bad", "--sink mine:Bad: requires --out"),
    ("teleop", "--reader mine:Bad", "--reader mine:Bad: requires --out"),
    ("teleop", "--bag out", "--bag: requires --out"),
    ("teleop", "--lidar vlp-16", "--lidar: requires --out"),
    ("map_recording", ". --out out", "it must contain depth.txt or images in depth/"),
    ("map_recording", ". --out out --intrinsics 1 1 0 1", "--intrinsics 1.0 1.0 0.0 1.0: all four values"),
    ("map_recording", ". --out out --fps 0", "--fps 0.0: must be above 0 and below 1,000,000"),
    ("map_recording", "pipe --out out", "error: pipe: "),
    ("export_arena", "--arena cut.raf --out a.xml", "cut.raf: cannot be parsed as XML: "),
    ("export_arena", "--arena bomb.raf --out a.xml", "bomb.raf: refused"),
    ("export_arena", "--arena unknown.raf --out a.xml", "xwall"),
    ("export_arena", "--arena bomb.xml --out a.xml", "bomb.xml: refused"),
    ("export_arena", "--arena empty_geom.xml --out a.xml", "empty_geom.xml: cannot be read as MJCF: "),
    ("export_arena", "--arena map.yaml --out a.xml", "none.pgm: cannot be read: No such file"),
    ("export_arena", "--arena small.xml --out none/a.xml", "/none"),
    ("export_arena", "--arena small.xml --out a.urdf", ".xml"),
    ("export_arena", "--arena small.xml --out folder.xml", "cannot be written"),
    ("generate_dataset", "--frames 0 --out out", "--frames 0:"),
    ("generate_dataset", "--arenas nist_6x4 --out /proc/data", "/proc/data: "),
    ("export_dataset", "tum --data . --out out", "not a dataset"),
    ("validate_mission", "none", "none: no such file or folder"),
]


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with the files that are named above, on a machine without a display."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    for name, content in FILES.items():
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_text(content)
    Path("pickle.safetensors").write_bytes(pickle.dumps({"conv1.0.weight": 1}))
    Path("folder.xml").mkdir()
    os.mkfifo("pipe")
    return tmp_path


@pytest.mark.parametrize(("command", "line", "hint"), LATE)
def test_what_turns_out_to_be_wrong_is_refused_in_one_line(
    command: str,
    line: str,
    hint: str,
    workplace: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    before = sorted(workplace.rglob("*"))
    monkeypatch.setattr(sys, "argv", [command, *line.split()])
    with pytest.raises(SystemExit) as ended:
        import_module(f"scripts.{command}").main()
    said = capfd.readouterr().err
    assert (ended.value.code, said.count("\n")) == (2, 1), said
    assert said.startswith("error: ") and hint in said
    assert sorted(workplace.rglob("*")) == before
