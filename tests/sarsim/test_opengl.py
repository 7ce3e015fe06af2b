"""Machines that cannot render: what renders says so in one line, and everything else works."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[2] / "scripts"
NO_DRIVER = {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent"}
RENDER = "from sarsim.opengl import check_rendering; check_rendering()"


def run(*words: object, **changes: str) -> subprocess.CompletedProcess[str]:
    """Run Python without a display, and with changed variables of the environment."""
    env = {key: value for key, value in os.environ.items() if "DISPLAY" not in key} | changes
    return subprocess.run([sys.executable, *map(str, words)], env=env, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("script", ["run_episode.py", "generate_dataset.py"])
def test_a_command_that_cannot_render_ends_with_one_line_and_leaves_nothing(script: str, tmp_path: Path) -> None:
    ended = run(SCRIPTS / script, "--out", tmp_path / "out", **NO_DRIVER)
    assert ended.returncode == 2
    (line,) = ended.stderr.splitlines()
    assert "MUJOCO_GL=egl" in line and "libegl1" in line
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("changes", "subject"),
    [
        (NO_DRIVER, "MUJOCO_GL=egl"),
        ({"MUJOCO_GL": "glfw"}, "MUJOCO_GL=glfw"),
        ({"MUJOCO_GL": "glfw", "DISPLAY": ":77"}, "MUJOCO_GL=glfw"),
        ({"MUJOCO_GL": "nonsense"}, "MUJOCO_GL=nonsense"),
        ({"MUJOCO_EGL_DEVICE_ID": "99"}, "MUJOCO_EGL_DEVICE_ID=99"),
        ({"PYOPENGL_PLATFORM": "osmesa"}, "PYOPENGL_PLATFORM=osmesa"),
    ],
)
def test_the_reason_names_the_variable(changes: dict[str, str], subject: str) -> None:
    *_, reason = run("-c", RENDER, **changes).stderr.splitlines()
    assert reason.startswith("pipeline.errors.InputError") and subject in reason


@pytest.mark.parametrize("changes", [NO_DRIVER, {"MUJOCO_GL": "nonsense"}, {"MUJOCO_GL": "osmesa"}])
def test_an_arena_is_exported_without_rendering(changes: dict[str, str], tmp_path: Path) -> None:
    ended = run(SCRIPTS / "export_arena.py", "--arena", "nist_6x4", "--out", tmp_path / "arena.xml", **changes)
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "arena.xml").exists()


def test_an_empty_variable_chooses_what_no_variable_does() -> None:
    ended = run("-c", RENDER, MUJOCO_GL="")
    assert ended.returncode == 0, ended.stderr


def test_a_broken_mujoco_is_not_taken_for_a_lack_of_opengl(tmp_path: Path) -> None:
    (tmp_path / "mujoco").mkdir()
    (tmp_path / "mujoco" / "__init__.py").write_text("raise ImportError('its core is missing')\n")
    ended = run("-c", RENDER, PYTHONPATH=f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}")
    assert "MuJoCo cannot be imported: its core is missing" in ended.stderr and "EGL" not in ended.stderr
