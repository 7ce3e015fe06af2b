"""Names that are not there are refused in one line, before anything that takes seconds is imported."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from sarsim.arenas.load import BUILDERS
from sarsim.arenas.names import BUILT_FILES, BUILT_IN, check_arena_name
from sarsim.assets import asset
from sarsim.settings import EpisodeConfig

HEAVY = ("mujoco", "dm_control", "torch", "numba", "scipy", "cv2", "h5py", "rerun")
REFUSED = [
    ("run_episode", "--arena nist_9x9", "nist_6x4"),
    ("run_episode", "--arena random:x", "random:x"),
    ("run_episode", "--arena none.sdf", "none.sdf"),
    ("run_episode", "--arena nowhere:build", "nowhere"),
    ("run_episode", "--robot r2d2", "jackal"),
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
    ("run_episode", "--map none", "--map none"),
    ("run_episode", "--resume none", "--resume none"),
    ("run_episode", "--out full", "full"),
    ("map_recording", "none --out a", "none"),
    ("map_recording", ". --out a --labels pointnext2", "pointnext"),
    ("teleop", "--arena nist_9x9", "nist_6x4"),
    ("export_arena", "--arena nist_9x9 --out a.xml", "nist_6x4"),
    ("score_mission", ". --arena nist_9x9", "nist_6x4"),
    ("sweep", "--methods nearest", "nearest_frontier"),
    ("sweep", "--arenas nist_9x9", "nist_6x4"),
    ("generate_dataset", "--arenas nist_6x4 nist_9x9 --out a", "esogu_52x15"),
    ("train", "pointnext3 --data . --out a.safetensors", "pointnext"),
    ("train", "pointnext --data none --out a.safetensors", "--data none"),
    ("train", "pointnext --data . --init none --out a.safetensors", "--init none"),
]
PROGRAM = f"""
import contextlib, importlib, io, json, sys
answers = []
for name, line, _ in {REFUSED!r}:
    sys.argv = [name, *line.split()]
    said = io.StringIO()
    with contextlib.redirect_stderr(said):
        try:
            importlib.import_module("sarsim.commands." + name).main()
        except SystemExit as ended:
            status = ended.code
    answers.append((status, said.getvalue(), [module for module in {HEAVY!r} if module in sys.modules]))
print(json.dumps(answers))
"""


def test_they_are_refused_in_one_line_before_what_is_slow_is_imported_and_leave_nothing(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "report.json").touch()
    run = subprocess.run([sys.executable, "-c", PROGRAM], cwd=tmp_path, capture_output=True, text=True, check=True)
    for (name, line, hint), (status, said, heavy) in zip(REFUSED, json.loads(run.stdout), strict=True):
        assert (status, said.count("\n"), heavy) == (2, 1, []), (name, line, said)
        assert hint in said, (name, line, said)
    assert run.stderr == ""
    assert [path.name for path in tmp_path.iterdir()] == ["full"]


def test_the_names_are_those_of_what_is_there() -> None:
    assert set(BUILT_FILES) == set(BUILDERS)
    files = [name for name in BUILT_IN if not name.startswith("lanes/")]
    assert all(asset("arenas", f"{name}.xml").exists() for name in files)
    for name in (*BUILT_IN, "random:3"):
        check_arena_name(name)


@pytest.mark.parametrize(
    ("arena", "name"),
    [
        ("nist_6x4", "nist_6x4-2"),
        ("random:7", "random-7-2"),
        ("lanes/krails", "krails-2"),
        ("worlds/my world?.sdf", "my-world--2"),
        ("my.arenas:build", "my.arenas-build-2"),
    ],
)
def test_a_run_gets_a_folder_of_its_own_with_a_portable_name(
    arena: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    config = EpisodeConfig(arena=arena, seed=2)
    assert config.folder == Path("runs", name)
    config.folder.mkdir(parents=True)
    assert config.folder == Path("runs", f"{name}-2")
    (tmp_path / "runs" / f"{name}-2").mkdir()
    assert config.folder == Path("runs", f"{name}-3")
