"""Paths of the robot models, network weights and other assets."""

from pathlib import Path

_INSTALLED = Path(__file__).with_name("asset_files")
_ASSETS = _INSTALLED if _INSTALLED.is_dir() else Path(__file__).parents[1] / "assets"


def asset(*parts: str) -> Path:
    """Path of a file in the assets folder, such as ``asset("robots", "pioneer3at", "scene.xml")``."""
    return _ASSETS.joinpath(*parts)
