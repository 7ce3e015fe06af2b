"""Paths of the models and weights."""

from pathlib import Path

_ASSETS = Path(__file__).with_name("assets")


def asset(*parts: str) -> Path:
    """Path of a file in the assets folder, such as ``asset("robots", "pioneer3at", "scene.xml")``."""
    return _ASSETS.joinpath(*parts)
