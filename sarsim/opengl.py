"""OpenGL for MuJoCo's rendering: the platform, which MUJOCO_GL names, and what to do if it cannot start."""

import os
import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from importlib.util import spec_from_file_location
from types import ModuleType
from typing import Any

from pipeline.errors import InputError

_REMEDIES = {
    "egl": "run 'sudo apt-get install libegl1 libgl1-mesa-dri' or set MUJOCO_GL=osmesa",
    "osmesa": "run 'sudo apt-get install libosmesa6' or set MUJOCO_GL=egl",
    "glfw": "set MUJOCO_GL=egl, which needs no display, or set DISPLAY to a running X server",
}
"""For each platform that MuJoCo supports on Linux, what to do if it cannot start."""
_MISSING = {
    "egl": "EGL cannot render on this machine",
    "osmesa": "OSMesa cannot render on this machine",
    "glfw": "GLFW cannot open a display",
}
_VARIABLES = ("PYOPENGL_PLATFORM", "MUJOCO_EGL_DEVICE_ID")
"""Other environment variables that choose a platform or device."""
_DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY")
_STARTERS = ("mujoco.rendering.classic.gl_context", "dm_control._render")
"""Modules that start OpenGL on import; importing MuJoCo or dm_control imports them."""


def choose_platform() -> None:
    """Choose EGL unless MUJOCO_GL names a platform, and make MuJoCo importable even if the platform cannot start.

    MuJoCo reads MUJOCO_GL once, when it is first imported.
    """
    if not os.environ.get("MUJOCO_GL"):
        os.environ["MUJOCO_GL"] = "egl"
    sys.meta_path.insert(0, _Finder())


def offscreen_context(width: int, height: int) -> Any:
    """An OpenGL context of the platform that MUJOCO_GL names, made current.

    ``mujoco.GLContext`` would use another platform if mujoco was imported before sarsim, which sets MUJOCO_GL.

    Raises:
        InputError: the platform does not exist, or cannot start on this machine.
    """
    name = os.environ["MUJOCO_GL"]
    platform = name.strip().lower()
    if platform not in _REMEDIES:
        raise InputError(f"MUJOCO_GL={name}: must be egl, osmesa or glfw; egl needs no display")
    try:
        with warnings.catch_warnings(action="ignore"):  # GLFW's errors
            context = import_module(f"mujoco.{platform}").GLContext(width, height)
            context.make_current()
            if platform == "glfw" and not import_module("glfw").get_current_context():
                raise OSError("no display")
    except Exception as error:  # from MuJoCo, PyOpenGL or ctypes
        raise InputError(f"MUJOCO_GL={name}: {_reason(error, platform)}") from error
    return context


def check_rendering() -> None:
    """Raises InputError if this machine cannot render."""
    offscreen_context(1, 1).free()


def check_display() -> None:
    """Raises InputError if no window can be opened."""
    with warnings.catch_warnings(action="ignore"):
        if not import_module("glfw").init():
            variables = " ".join(f"{name}={os.environ[name]}" for name in _DISPLAYS if name in os.environ)
            remedy = f"set {_DISPLAYS[0]} to a running X server, such as :0"
            raise InputError(f"{variables or 'no display'}: MuJoCo's viewer cannot open a window; {remedy}")


def _reason(error: Exception, platform: str) -> str:
    """What is wrong and what to do, in one line; the errors themselves only name OpenGL functions."""
    for variable in _VARIABLES:
        if variable in str(error):
            return f"{variable}={os.environ.get(variable)} cannot be used on this machine; unset it"
    return f"{_MISSING[platform]}; {_REMEDIES[platform]}"


class _Finder(PathFinder):
    """Finds the modules that start OpenGL."""

    @classmethod
    def find_spec(
        cls, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        spec = super().find_spec(fullname, path, target) if fullname in _STARTERS else None
        if spec is None or spec.origin is None:
            return None
        folders = spec.submodule_search_locations
        loader = _Loader(fullname, spec.origin)
        return spec_from_file_location(fullname, spec.origin, loader=loader, submodule_search_locations=folders)


class _Loader(SourceFileLoader):
    """Loads a module that starts OpenGL, without OpenGL if that cannot start, because not all commands render."""

    def exec_module(self, module: ModuleType) -> None:
        platform = os.environ["MUJOCO_GL"]
        try:
            with warnings.catch_warnings(action="ignore"):  # GLFW's errors
                super().exec_module(module)
        except Exception:
            os.environ["MUJOCO_GL"] = "disable"
            super().exec_module(module)
        finally:
            os.environ["MUJOCO_GL"] = platform
