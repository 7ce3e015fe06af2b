"""OpenGL for MuJoCo's rendering: the platform, which MUJOCO_GL names, and the remedies if it cannot start."""

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from pipeline.errors import InputError

_REMEDIES = {
    "egl": "run 'sudo apt-get install libegl1 libgl1-mesa-dri' or set MUJOCO_GL=osmesa",
    "osmesa": "run 'sudo apt-get install libosmesa6' or set MUJOCO_GL=egl",
    "glfw": "set MUJOCO_GL=egl, which needs no display, or set DISPLAY to a running X server",
}
"""The remedy for each platform that MuJoCo supports on Linux, if the platform cannot start."""
_FAILURES = {
    "egl": "EGL cannot render on this machine",
    "osmesa": "OSMesa cannot render on this machine",
    "glfw": "GLFW cannot open a display",
}
_DEVICE_VARIABLES = ("PYOPENGL_PLATFORM", "MUJOCO_EGL_DEVICE_ID")
"""Other environment variables that choose a platform or device."""
_DISPLAY_VARIABLES = ("DISPLAY", "WAYLAND_DISPLAY")


def choose_platform() -> None:
    """Choose EGL unless MUJOCO_GL, which MuJoCo and dm_control read at their first import, names a platform."""
    os.environ["MUJOCO_GL"] = os.environ.get("MUJOCO_GL") or "egl"


@contextmanager
def without_opengl() -> Iterator[None]:
    """Let MuJoCo and dm_control be imported in the block without OpenGL, which may not start on this machine."""
    before = os.environ.get("MUJOCO_GL", "")
    os.environ["MUJOCO_GL"] = "disable"
    try:
        yield
    finally:
        os.environ["MUJOCO_GL"] = before


def offscreen_context(width: int, height: int) -> Any:
    """A current OpenGL context of the platform that MUJOCO_GL names, even if MuJoCo was imported without OpenGL.

    Raises:
        InputError: the platform does not exist, or cannot start on this machine.
    """
    name = os.environ.get("MUJOCO_GL") or "egl"
    platform = name.strip().lower()
    if platform not in _REMEDIES:
        raise InputError(f"MUJOCO_GL={name}: must be egl, osmesa or glfw; egl needs no display")
    try:
        import_module("mujoco")
    except ImportError as error:  # a broken installation, not a problem with OpenGL
        said = " ".join(str(error).split())[:200]
        raise InputError(f"MuJoCo cannot be imported: {said}; install sarsim's packages again") from error
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
    """Raise InputError if this machine cannot render."""
    offscreen_context(1, 1).free()


def check_display() -> None:
    """Raise InputError if no window can be opened."""
    with warnings.catch_warnings(action="ignore"):
        if not import_module("glfw").init():
            variables = " ".join(f"{name}={os.environ[name]}" for name in _DISPLAY_VARIABLES if name in os.environ)
            remedy = f"set {_DISPLAY_VARIABLES[0]} to a running X server, such as :0"
            raise InputError(f"{variables or 'no display'}: MuJoCo's viewer cannot open a window; {remedy}")


def _reason(error: Exception, platform: str) -> str:
    """The cause and the remedy in one line, because the errors themselves name only OpenGL functions."""
    for variable in _DEVICE_VARIABLES:
        if variable in str(error):
            return f"{variable}={os.environ.get(variable)} cannot be used on this machine; unset it"
    return f"{_FAILURES[platform]}; {_REMEDIES[platform]}"
