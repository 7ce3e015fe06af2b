"""Where the models and weights lie."""

from pathlib import Path

_ASSETS = Path(__file__).with_name("assets")


def asset(*parts: str) -> Path:
    """Path of a file in the assets folder, ``asset("robots", "pioneer3at", "scene.xml")``."""
    return _ASSETS.joinpath(*parts)
