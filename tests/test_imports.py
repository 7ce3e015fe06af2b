"""Modules import only downwards (the contracts of pyproject.toml), and importing them leaves the process as it is."""

import os
import subprocess
import sys
from pathlib import Path

from tests.source_tree import ROOT

SET_BY_COMMANDS = ("MUJOCO_GL", "OPENBLAS_NUM_THREADS", "OPENCV_IO_MAX_IMAGE_PIXELS")
IMPORT_ALL = """
import importlib, os, sys
names, sys.argv[1:] = sys.argv[1:], []
for name in names:
    importlib.import_module(name)
hooks = [type(hook).__module__ for hook in [*sys.meta_path, *sys.path_hooks]]
print(*(name for name in [*os.environ, *hooks] if name.startswith(("SARSIM", "sarsim", "pipeline"))))
print(*(name for name in SET_BY_COMMANDS if name in os.environ))
"""


def test_the_contracts_about_imports_hold() -> None:
    lint = [Path(sys.executable).with_name("lint-imports"), "--no-cache"]
    done = subprocess.run(lint, cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_importing_a_module_changes_neither_the_environment_nor_how_python_imports() -> None:
    paths = [path.relative_to(ROOT) for package in ("pipeline", "sarsim") for path in (ROOT / package).rglob("*.py")]
    names = [".".join(path.with_suffix("").parts).removesuffix(".__init__") for path in sorted(paths)]
    env = {name: value for name, value in os.environ.items() if name not in SET_BY_COMMANDS}
    code = f"SET_BY_COMMANDS = {SET_BY_COMMANDS}\n{IMPORT_ALL}"
    done = subprocess.run([sys.executable, "-c", code, *names], env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "\n\n"
