"""Draw README's badges from pyproject.toml and store them as files, so that they also display offline."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "badges"
CHARACTER_WIDTH, MARGIN, HEIGHT = 6.4, 6, 20  # px, at a font size of 11
TEMPLATE = """<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" role="img"
 aria-label="{left}: {right}">
<rect width="{width}" height="{height}" rx="3" fill="#444"/>
<path d="M{middle} 0h{rest}a3 3 0 0 1 3 3v14a3 3 0 0 1-3 3h-{rest}z" fill="#00695c"/>
<g fill="#fff" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11">
<text x="{margin}" y="14">{left}</text><text x="{start}" y="14">{right}</text></g></svg>
"""


def badge(left: str, right: str) -> str:
    """A badge with a name and a value, as SVG."""
    middle = round(len(left) * CHARACTER_WIDTH) + 2 * MARGIN
    width = middle + round(len(right) * CHARACTER_WIDTH) + 2 * MARGIN
    rest, start = width - middle - 3, middle + MARGIN
    return TEMPLATE.format(
        width=width, height=HEIGHT, left=left, right=right, middle=middle, rest=rest, margin=MARGIN, start=start
    )


def badges() -> dict[Path, str]:
    """The file and the SVG text of every badge."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    pins = dict(d.split("==") for d in project["dependencies"] if "==" in d)
    shown = {
        "version": project["version"],
        "python": "3.11 – 3.14",
        "mujoco": pins["mujoco"],
        "license": project["license"],
    }
    return {FOLDER / f"{name}.svg": badge(name, value) for name, value in shown.items()}


def draw() -> None:
    """Write the badges."""
    for file, text in badges().items():
        file.write_text(text)
