"""How the elements of the league's 2D map look, and the limits that its files keep."""

from importlib.resources import files

import yaml

_TABLE = yaml.safe_load(files(__package__).joinpath("rules.yaml").read_text())

COLOURS: dict[str, tuple[int, ...]] = {name: tuple(colour) for name, colour in _TABLE["colours"].items()}
"""RGB by element."""
LENGTHS: dict[str, float] = _TABLE["lengths"]
"""m, by element."""
LIMITS: dict[str, float] = _TABLE["limits"]
"""What a judge's tools would stumble over, by name."""


def pixels(element: str, share: float = 1.0) -> int:
    """Whole pixels of a ``share`` of an element's length, at least one."""
    return max(1, round(share * LENGTHS[element] / LENGTHS["pixel"]))
