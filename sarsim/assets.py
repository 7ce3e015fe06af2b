"""Where the models and weights lie."""

from pathlib import Path

# An installed copy carries the folder inside the package; in a checkout it stands beside it.
_PACKAGED = Path(__file__).with_name("assets")
_CHECKOUT = Path(__file__).parents[1] / "assets"


def asset(*parts: str) -> Path:
    """Path of a file in the assets folder, ``asset("robots", "pioneer3at", "scene.xml")``."""
    return (_PACKAGED if _PACKAGED.is_dir() else _CHECKOUT).joinpath(*parts)
