"""The numbers of the leagues' rules: looks of the 2D map, points, and the limits that files keep."""

from importlib.resources import files

import yaml

_TABLE = yaml.safe_load(files(__package__).joinpath("rules.yaml").read_text())

MAP_COLOURS: dict[str, tuple[int, ...]] = {name: tuple(colour) for name, colour in _TABLE["colours"].items()}
"""RGB by element."""
LENGTHS: dict[str, float] = _TABLE["lengths"]
"""m, by element."""
POINTS: dict[str, float] = _TABLE["points"]
"""Points and factors of the leagues, by what earns or costs them."""
LIMITS: dict[str, float] = _TABLE["limits"]
"""What a judge's tools would stumble over, by name."""


def pixels(element: str, share: float = 1.0) -> int:
    """Whole pixels of a ``share`` of an element's length, at least one."""
    return max(1, round(share * LENGTHS[element] / LENGTHS["pixel"]))
